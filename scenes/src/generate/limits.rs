//! What the generators' parameters may be.

use super::Generator;

/// Most triangles in one made mesh.
const MAX_TRIANGLES: u64 = 1 << 24;

impl Generator {
    /// Whether [`Generator::make`] can make a mesh of these parameters; chains, tubes, heads and plants check their own.
    ///
    /// # Errors
    /// What is wrong with which parameter.
    pub(super) fn check(&self) -> Result<(), String> {
        match self {
            &Self::Torus {
                major,
                minor,
                around,
                across,
            } => {
                positive("minor", minor)?;
                less("minor", minor, "major", major)?;
                counts(&[("around", around, 3), ("across", across, 3)])
            }
            &Self::Sphere {
                radius,
                around,
                across,
            } => {
                positive("radius", radius)?;
                counts(&[("around", around, 3), ("across", across, 2)])
            }
            &Self::Capsule {
                radius,
                height,
                around,
                across,
            } => {
                positive("radius", radius)?;
                positive("height", height)?;
                if !across.is_multiple_of(2) {
                    return Err(format!("across = {across} must be even"));
                }
                counts(&[("around", around, 3), ("across", across, 2)])
            }
            &Self::Icosphere { radius, steps } => {
                positive("radius", radius)?;
                if steps > 8 {
                    return Err(format!("steps = {steps} must be at most 8"));
                }
                Ok(())
            }
            &Self::Cylinder {
                radius,
                height,
                around,
            } => {
                positive("radius", radius)?;
                positive("height", height)?;
                counts(&[("around", around, 3)])
            }
            Self::Lathe {
                profile,
                ring,
                around,
            } => {
                check_profile(profile, *ring)?;
                counts(&[("around", *around, 3), ("profile", profile.len() as u32, 3)])
            }
            Self::Box { size } => all_positive("size", size),
            &Self::Plane {
                size,
                cells,
                repeat,
            } => {
                all_positive("size", &size)?;
                if !repeat.iter().all(|r| r.is_finite()) {
                    return Err("repeat must be finite".into());
                }
                counts(&[("cells", cells[0], 1), ("cells", cells[1], 1)])
            }
            &Self::Bars {
                size,
                bars,
                width,
                thickness,
                cells,
            } => {
                all_positive("size", &size)?;
                all_positive("width and thickness", &[width, thickness])?;
                counts(&[("bars", bars[0], 2), ("bars", bars[1], 2), ("sides", 16, 1)])?;
                let both = bars[0].saturating_add(bars[1]);
                counts(&[("bars", both, 4), ("cells", cells, 0), ("sides", 8, 1)])?;
                for (s, n) in size.into_iter().zip(bars) {
                    less("bars times width", n as f32 * width, "size", s)?;
                }
                Ok(())
            }
            Self::Wall {
                size,
                openings,
                cell,
            } => {
                all_positive("size", size)?;
                positive("cell", *cell)?;
                if size[0] / cell > 1e3 || size[1] / cell > 1e3 {
                    return Err(format!("cell = {cell} cuts the wall more than 1000 times"));
                }
                if openings.len() > 100 {
                    return Err("openings must be at most 100".into());
                }
                openings
                    .iter()
                    .try_for_each(|o| check_opening(*o, size[0], size[1]))
            }
            Self::Chain(_) | Self::Tube(_) | Self::Head(_) | Self::Plants(_) | Self::Crown(_) => {
                Ok(())
            }
            &Self::Table {
                size,
                thickness,
                leg,
            } => {
                all_positive(
                    "size, thickness and leg",
                    &[size[0], size[1], size[2], thickness, leg],
                )?;
                less("thickness", thickness, "size[1]", size[1])?;
                less(
                    "twice leg",
                    2.0 * leg,
                    "size[0] and size[2]",
                    size[0].min(size[2]),
                )
            }
            &Self::Chair { size, seat, slats } => {
                all_positive("size and seat", &[size[0], size[1], size[2], seat])?;
                less("seat", seat, "size[1]", size[1])?;
                less(
                    "0.2",
                    0.2,
                    "each size and seat",
                    size[0].min(size[2]).min(seat),
                )?;
                counts(&[("slats", slats.min(64), 1), ("sides", 12, 1)])?;
                less("slats", slats as f32, "64", 64.0)
            }
            &Self::Shelf {
                size,
                boards,
                thickness,
            } => {
                all_positive(
                    "size and thickness",
                    &[size[0], size[1], size[2], thickness],
                )?;
                counts(&[("boards", boards, 2), ("sides", 12, 1)])?;
                less(
                    "boards times thickness",
                    boards as f32 * thickness,
                    "size[1]",
                    size[1],
                )?;
                less(
                    "twice thickness",
                    2.0 * thickness,
                    "size[0] and size[2]",
                    size[0].min(size[2]),
                )
            }
            &Self::Books {
                length,
                height,
                depth,
                part,
                of,
                ..
            } => {
                all_positive("length, height and depth", &[length, height, depth])?;
                less("length", length, "1000", 1000.0)?;
                less("part", part as f32, "of", of as f32)
            }
        }
    }
}

fn check_profile(profile: &[[f32; 2]], ring: bool) -> Result<(), String> {
    let n = profile.len();
    if !profile.iter().flatten().all(|x| x.is_finite()) || profile.iter().any(|p| p[0] < 0.0) {
        return Err("profile must hold finite points (radius, y) with radius >= 0".into());
    }
    if n < 3 || profile.windows(2).any(|w| w[0] == w[1]) {
        return Err("profile needs at least 3 points, each different from the last".into());
    }
    let on_axis = |i: usize| profile[i][0] == 0.0;
    if (1..n - 1).any(on_axis) || on_axis(0) == ring || on_axis(n - 1) == ring {
        return Err("profile must touch the axis at both ends, or with ring = true nowhere".into());
    }
    Ok(())
}

fn check_opening([x0, y0, x1, y1]: [f32; 4], length: f32, height: f32) -> Result<(), String> {
    let inside = |low: f32, high: f32, end: f32| low >= 0.0 && low < high && high <= end;
    if inside(x0, x1, length) && inside(y0, y1, height) {
        Ok(())
    } else {
        Err(format!(
            "opening [{x0}, {y0}, {x1}, {y1}] must be [x from, y from, x to, y to] in the wall"
        ))
    }
}

pub(super) fn positive(name: &str, value: f32) -> Result<(), String> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(format!("{name} = {value} must be greater than 0"))
    }
}

fn all_positive(name: &str, values: &[f32]) -> Result<(), String> {
    values.iter().try_for_each(|&v| positive(name, v))
}

pub(super) fn less(name: &str, value: f32, limit_name: &str, limit: f32) -> Result<(), String> {
    if value < limit && limit.is_finite() {
        Ok(())
    } else {
        Err(format!(
            "{name} = {value} must be less than {limit_name} = {limit}"
        ))
    }
}

/// Each count must reach its least, and their product must stay within [`MAX_TRIANGLES`].
pub(super) fn counts(given: &[(&str, u32, u32)]) -> Result<(), String> {
    let mut product = 2_u64;
    for &(name, value, least) in given {
        if value < least {
            return Err(format!("{name} = {value} must be at least {least}"));
        }
        product = product.saturating_mul(value.into());
    }
    if product > MAX_TRIANGLES {
        return Err(format!(
            "{product} triangles are more than the {MAX_TRIANGLES} allowed"
        ));
    }
    Ok(())
}
