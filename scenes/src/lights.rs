//! Lights of a scene file, checked.

use glam::DVec3;
use protocol::scene::Light;

use crate::error::ErrorKind;
use crate::format::{LightKind, LightTable};

/// Turns a `[[light]]` into a light.
///
/// # Errors
/// A key that is missing, has no use for this kind or has a value that makes no light.
pub(crate) fn light(table: &LightTable) -> Result<Light, ErrorKind> {
    let keys = [
        ("position", table.position.is_some(), LightKind::Point),
        ("from", table.from.is_some(), LightKind::Linear),
        ("to", table.to.is_some(), LightKind::Linear),
        ("vertices", table.vertices.is_some(), LightKind::Area),
        ("radiance", table.radiance.is_some(), LightKind::Area),
    ];
    for (key, given, kind) in keys {
        if given != (kind == table.kind) {
            return Err(needs(key, given, table.kind));
        }
    }
    let power = match table.kind {
        LightKind::Area => table.radiance,
        LightKind::Point | LightKind::Linear => table.intensity,
    };
    if table.intensity.is_some() == (table.kind == LightKind::Area) {
        return Err(needs("intensity", table.intensity.is_some(), table.kind));
    }
    let power = color(
        "light.intensity or light.radiance",
        power.unwrap_or_default(),
    )?;
    match table.kind {
        LightKind::Point => Ok(Light::Point {
            position: finite("light.position", table.position.unwrap_or_default())?,
            intensity: power,
        }),
        LightKind::Linear => {
            let from = finite("light.from", table.from.unwrap_or_default())?;
            let to = finite("light.to", table.to.unwrap_or_default())?;
            if from == to {
                return Err(ErrorKind::value(
                    "light.to",
                    "is where from is",
                    "move one of them",
                ));
            }
            Ok(Light::Linear {
                from,
                to,
                intensity: power,
            })
        }
        LightKind::Area => {
            let vertices = table.vertices.clone().unwrap_or_default();
            check_polygon(&vertices)?;
            Ok(Light::Area {
                vertices,
                radiance: power,
            })
        }
    }
}

fn needs(key: &str, given: bool, kind: LightKind) -> ErrorKind {
    let name = format!("{kind:?}").to_lowercase();
    if given {
        let problem = format!("a {name} light has no {key}");
        ErrorKind::value(
            format!("light.{key}"),
            problem,
            "remove it or change the kind",
        )
    } else {
        let problem = format!("a {name} light needs {key}");
        ErrorKind::value(format!("light.{key}"), problem, "add it")
    }
}

/// Three finite numbers.
pub(crate) fn finite(key: &str, v: [f32; 3]) -> Result<[f32; 3], ErrorKind> {
    if v.iter().all(|x| x.is_finite()) {
        Ok(v)
    } else {
        Err(ErrorKind::value(
            key,
            format!("{v:?} is not finite"),
            "write three finite numbers",
        ))
    }
}

/// Three finite numbers that are not negative.
pub(crate) fn color(key: &str, v: [f32; 3]) -> Result<[f32; 3], ErrorKind> {
    if v.iter().all(|x| x.is_finite() && *x >= 0.0) {
        Ok(v)
    } else {
        let problem = format!("{v:?} is not a colour");
        Err(ErrorKind::value(
            key,
            problem,
            "write three finite numbers of at least 0",
        ))
    }
}

/// Most vertices of an area light.
const MAX_VERTICES: usize = 64;

/// Planar to a thousandth of its size, convex, not without area.
fn check_polygon(vertices: &[[f32; 3]]) -> Result<(), ErrorKind> {
    let bad = |problem: String| {
        Err(ErrorKind::value(
            "light.vertices",
            problem,
            "give the corners of a planar convex polygon in order, anticlockwise from the side that shines",
        ))
    };
    if !(3..=MAX_VERTICES).contains(&vertices.len()) {
        return bad(format!(
            "{} corners, not 3 to {MAX_VERTICES}",
            vertices.len()
        ));
    }
    for v in vertices {
        finite("light.vertices", *v)?;
    }
    let p: Vec<DVec3> = vertices
        .iter()
        .map(|v| DVec3::from_array(v.map(f64::from)))
        .collect();
    let n = p.len();
    let area: DVec3 = (1..n - 1)
        .map(|i| (p[i] - p[0]).cross(p[i + 1] - p[0]))
        .sum();
    let size = p.iter().map(|q| (*q - p[0]).length()).fold(0.0, f64::max);
    if area.length() <= 1e-9 * size * size || size == 0.0 {
        return bad("the polygon has no area".into());
    }
    let normal = area.normalize();
    if let Some(i) = (0..n).find(|&i| (p[i] - p[0]).dot(normal).abs() > 1e-3 * size) {
        return bad(format!(
            "corner {} is out of the plane of the others",
            i + 1
        ));
    }
    let turning = |i: usize| {
        let (a, b, c) = (p[i], p[(i + 1) % n], p[(i + 2) % n]);
        (b - a).cross(c - b).dot(normal)
    };
    if let Some(i) = (0..n).find(|&i| turning(i) < -1e-9 * size * size) {
        return bad(format!(
            "the polygon turns inwards at corner {}",
            (i + 1) % n + 1
        ));
    }
    // A polygon that winds more than once turns the same way everywhere, yet its fan is larger than its outline.
    let fan: f64 = (1..n - 1)
        .map(|i| (p[i] - p[0]).cross(p[i + 1] - p[0]).dot(normal).min(0.0))
        .sum();
    if fan < -1e-9 * size * size {
        return bad("the polygon crosses itself".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_must_be_planar_and_convex() {
        let z = |p: &[[f32; 2]]| p.iter().map(|&[x, y]| [x, y, 0.0]).collect::<Vec<_>>();
        assert!(check_polygon(&z(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])).is_ok());
        assert!(check_polygon(&z(&[[0.0, 0.0], [1.0, 0.0]])).is_err());
        assert!(check_polygon(&z(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])).is_err());
        let dent = [[0.0, 0.0], [1.0, 0.0], [0.2, 0.2], [0.0, 1.0]];
        assert!(check_polygon(&z(&dent)).is_err());
        let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.5]];
        assert!(check_polygon(&z(&bow)).is_err());
        let star: Vec<[f32; 2]> = (0..5)
            .map(|i| {
                let a = i as f32 * 2.0 * std::f32::consts::TAU / 5.0;
                [a.cos(), a.sin()]
            })
            .collect();
        assert!(check_polygon(&z(&star)).is_err());
        let mut bent = z(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        bent[2][2] = 0.1;
        assert!(check_polygon(&bent).is_err());
    }
}
