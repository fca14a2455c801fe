//! MTL materials: the keys that are used, checked line by line before tobj reads them.

use std::fmt::Write as _;
use std::path::Path;

use super::{FileMaterial, Picture};
use crate::error::{ErrorKind, SceneError};
use crate::report::LoadReport;

/// The lines of an MTL file that matter, in the form that tobj reads without fail; `None` if there is no such file.
pub(crate) fn clean(path: &Path) -> Result<Option<String>, SceneError> {
    let Ok(bytes) = std::fs::read(path) else {
        return Ok(None);
    };
    let text = String::from_utf8_lossy(&bytes);
    let mut out = String::new();
    let mut named = false;
    for (number, line) in text.lines().enumerate() {
        let bad = |what: String| SceneError::at(path, number + 1, ErrorKind::Malformed(what));
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match keyword {
            "newmtl" if rest.is_empty() => return Err(bad("newmtl has no name".into())),
            "newmtl" => {
                named = true;
                let _ = writeln!(out, "newmtl {rest}");
            }
            "Kd" | "Ks" | "Ke" | "Ns" if named => {
                let wanted = if keyword == "Ns" { 1 } else { 3 };
                let numbers = numbers(rest, wanted).map_err(|e| bad(format!("{keyword}: {e}")))?;
                let _ = write!(out, "{keyword}");
                for n in numbers {
                    let _ = write!(out, " {n}");
                }
                out.push('\n');
            }
            _ if named && keyword.eq_ignore_ascii_case("map_Kd") && !rest.is_empty() => {
                let _ = writeln!(out, "map_Kd {rest}");
            }
            _ => {}
        }
    }
    Ok(Some(out))
}

/// `wanted` finite numbers that are not negative; one alone stands for three equal ones.
fn numbers(rest: &str, wanted: usize) -> Result<Vec<f32>, String> {
    let rest = rest.split_once('#').map_or(rest, |(before, _)| before);
    let mut numbers = Vec::with_capacity(wanted);
    for word in rest.split_whitespace().take(wanted) {
        match word.parse::<f32>() {
            Ok(n) if n.is_finite() && n >= 0.0 => numbers.push(n),
            _ => return Err(format!("{word:?} is not a number of at least 0")),
        }
    }
    match numbers[..] {
        [one] => Ok(vec![one; wanted]),
        _ if numbers.len() == wanted => Ok(numbers),
        _ => Err(format!(
            "{} numbers where {wanted} are needed",
            numbers.len()
        )),
    }
}

/// `Kd`, `map_Kd` and `Ks` as they are; `Ns` becomes the GGX roughness whose lobe is as wide,
/// `sqrt(2 / (Ns + 2))` (Walter et al. 2007, section 5.2's Phong-Beckmann match).
pub(crate) fn convert(
    m: tobj::Material,
    directory: &Path,
    obj: &Path,
    report: &mut LoadReport,
) -> FileMaterial {
    if m.emissive.is_some_and(|e| e.iter().any(|&x| x > 0.0)) {
        report.notes.push(format!(
            "{}: material {:?} glows (Ke); it is a plain surface here, so add a [[light]]",
            obj.display(),
            m.name
        ));
    }
    let diffuse_map = m.diffuse_texture.as_deref().and_then(map_file);
    let default = if diffuse_map.is_some() {
        [1.0; 3]
    } else {
        [0.7; 3]
    };
    let limit = |c: [f32; 3]| c.map(|x| x.clamp(0.0, 1.0));
    FileMaterial {
        diffuse: limit(m.diffuse.unwrap_or(default)),
        diffuse_map: diffuse_map.map(|file| Picture::File(directory.join(file))),
        specular: limit(m.specular.unwrap_or([0.0; 3])),
        roughness: m
            .shininess
            .map_or(1.0, |n| (2.0 / (n + 2.0)).sqrt())
            .clamp(0.01, 1.0),
        name: m.name,
    }
}

/// The file in a `map_Kd` line: behind any options, with slashes that every system reads.
fn map_file(value: &str) -> Option<String> {
    let mut rest = value.trim();
    while let Some(option) = rest.strip_prefix('-') {
        let arguments = match option.split_whitespace().next() {
            Some("o" | "s" | "t") => 3,
            Some("mm") => 2,
            _ => 1,
        };
        let mut words = option.split_whitespace();
        words.next();
        let mut tail = option
            .split_once(char::is_whitespace)
            .map_or("", |(_, t)| t)
            .trim_start();
        for _ in 0..arguments {
            let Some((word, after)) = tail.split_once(char::is_whitespace) else {
                break;
            };
            // Vectors may be shorter than three numbers.
            if arguments > 1 && word.parse::<f32>().is_err() {
                break;
            }
            tail = after.trim_start();
        }
        if tail.len() >= rest.len() {
            break;
        }
        rest = tail;
    }
    (!rest.is_empty()).then(|| rest.replace('\\', "/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_before_a_map_are_skipped() {
        let file = |value| map_file(value).unwrap();
        assert_eq!(file("wood floor.png"), "wood floor.png");
        assert_eq!(file("-s 1 1 1 textures\\a b.jpg"), "textures/a b.jpg");
        assert_eq!(file("-clamp on -o 0.5 x.png"), "x.png");
        assert_eq!(map_file("-"), None);
    }

    #[test]
    fn one_number_is_a_grey_and_nonsense_is_refused() {
        assert_eq!(numbers("0.5", 3), Ok(vec![0.5; 3]));
        assert!(numbers("0.5 0.5", 3).is_err());
        assert!(numbers("nan 1 1", 3).is_err());
        assert!(numbers("-1 1 1", 3).is_err());
        assert!(numbers("", 1).is_err());
    }
}
