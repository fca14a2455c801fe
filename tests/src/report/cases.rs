//! The scenes that the report measures, and the pictures they are judged by.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use protocol::scene::Light;

use super::Places;

/// A scene with a still camera and perhaps an independent picture of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Case {
    /// Short name, unique, fit for a file name.
    pub name: String,
    /// The scene file.
    pub scene: PathBuf,
    /// A picture of the still camera by an independent renderer, linear EXR.
    pub picture: Option<PathBuf>,
    /// A camera path of the scene.
    pub path: Option<String>,
    /// Whether the scene has indirect light, which takes most of a run's time.
    pub is_indirect: bool,
    /// What a reader must know to judge the figures.
    pub remark: String,
}

/// What a scene file says that asks for indirect light.
const GLOBAL: &str = "model = \"global\"";
const OWN_REFERENCE: &str = "Judged by the renderer's own reference method.";

/// The scenes to measure. `--quick` takes the independent references alone where they are found.
///
/// # Errors
/// When a scene file cannot be adapted into `work`.
pub fn find(places: &Places, work: &Path, quick: bool) -> io::Result<Vec<Case>> {
    let mut cases = Vec::new();
    if let Some(shared) = &places.shared {
        cases.extend(references(&shared.join("references"), work)?);
    }
    if cases.is_empty() || !quick {
        cases.extend(["chains", "rooms"].map(|name| own(&places.checkout, name)));
    }
    Ok(cases)
}

/// The scenes in which shadow edges must pay, written into `work`: the scanned dragon where it is found, chains with its
/// lights shrunk to points, and built-in ones.
///
/// # Errors
/// When a scene file cannot be written into `work`.
pub fn with_shadows(places: &Places, work: &Path, quick: bool) -> io::Result<Vec<Case>> {
    let mut cases = Vec::new();
    let text = |name: &str| scenes::builtin_text(name).unwrap_or_default();
    let mut add = |name: &str, text: &str, remark: &str| -> io::Result<()> {
        let scene = work.join(format!("{name}.toml"));
        fs::write(&scene, text)?;
        cases.push(Case {
            name: name.to_owned(),
            scene,
            picture: None,
            path: Some("orbit".to_owned()),
            is_indirect: text.contains(GLOBAL),
            remark: remark.to_owned(),
        });
        Ok(())
    };
    let lights = scenes::builtin("chains")
        .map_err(io::Error::other)?
        .scene
        .lights;
    let points = with_point_lights(text("chains"), &lights);
    add(
        "chains-points",
        &points,
        "Chains with each light shrunk to a point of the same power along its normal.",
    )?;
    add(
        "torus",
        text("torus"),
        "A torus leans on a capsule: contact and wide penumbrae.",
    )?;
    if !quick {
        add("chains", text("chains"), "Penumbrae of all widths.")?;
        add("rooms", text("rooms"), "Mostly wide penumbrae.")?;
        add(
            "grid",
            text("grid"),
            "A grid of bars over a dragon made of tubes, one small light.",
        )?;
    }
    // Last, since it takes longest and gets what time the others leave.
    cases.extend(scanned_dragon(places).filter(|_| !quick));
    Ok(cases)
}

/// The five scenes of the 2003 paper as this project has them, written into `work`, the scanned dragon where it is found, and
/// the torus on a capsule; that one alone if `quick` is set.
///
/// # Errors
/// When a scene file cannot be written into `work`.
pub fn of_the_paper(places: &Places, work: &Path, quick: bool) -> io::Result<Vec<Case>> {
    let names: &[&str] = if quick {
        &["torus"]
    } else {
        &["rooms", "chains", "mack", "head", "dragon", "torus"]
    };
    let mut cases = Vec::new();
    for name in names {
        let scene = work.join(format!("{name}.toml"));
        let text = scenes::builtin_text(name).unwrap_or_default();
        fs::write(&scene, text)?;
        cases.push(Case {
            name: (*name).to_owned(),
            scene,
            picture: None,
            path: Some("orbit".to_owned()),
            is_indirect: text.contains(GLOBAL),
            remark: OWN_REFERENCE.to_owned(),
        });
    }
    cases.extend(scanned_dragon(places).filter(|_| !quick));
    Ok(cases)
}

fn scanned_dragon(places: &Places) -> Option<Case> {
    let folder = places.shared.as_ref()?.join("references/dragon");
    folder.join("ref.exr").is_file().then(|| Case {
        name: "dragon-reference".to_owned(),
        scene: folder.join("dragon.toml"),
        picture: Some(folder.join("ref.exr")),
        path: Some("move".to_owned()),
        is_indirect: false,
        remark: "The scanned dragon under a grid, one small light; judged by a Mitsuba 3 picture of the same scene.".to_owned(),
    })
}

/// A scene's text with every area light shrunk to a point in its middle, as bright as it is along its normal.
fn with_point_lights(text: &str, lights: &[Light]) -> String {
    let mut lights = lights.iter();
    let mut area = None;
    let mut out = String::new();
    for line in text.lines() {
        if line.starts_with('[') {
            area = None;
        }
        if line == "[[light]]" {
            area = match lights.next() {
                Some(Light::Area { vertices, radiance }) => Some((vertices, radiance)),
                _ => None,
            };
        }
        match (area, line.split(" = ").next()) {
            (Some(_), Some("kind")) => out += "kind = \"point\"",
            (Some((vertices, _)), Some("vertices")) => {
                out += &format!("position = {:?}", middle(vertices));
            }
            (Some((vertices, radiance)), Some("radiance")) => {
                let area = area_m2(vertices);
                out += &format!("intensity = {:?}", radiance.map(|r| r * area));
            }
            _ => out += line,
        }
        out.push('\n');
    }
    out
}

fn middle(vertices: &[[f32; 3]]) -> [f32; 3] {
    let mean = |k: usize| vertices.iter().map(|v| v[k]).sum::<f32>() / vertices.len() as f32;
    [mean(0), mean(1), mean(2)]
}

/// Area of a planar convex polygon, m².
fn area_m2(vertices: &[[f32; 3]]) -> f32 {
    let minus = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let triangle = |b: [f32; 3], c: [f32; 3]| {
        let (u, v) = (minus(b, vertices[0]), minus(c, vertices[0]));
        let cross =
            [0, 1, 2].map(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]);
        cross.iter().map(|x| x * x).sum::<f32>().sqrt() / 2.0
    };
    vertices
        .windows(2)
        .skip(1)
        .map(|w| triangle(w[0], w[1]))
        .sum()
}

fn own(checkout: &Path, name: &str) -> Case {
    Case {
        name: name.to_owned(),
        scene: checkout.join(format!("scenes/{name}.toml")),
        picture: None,
        path: Some("orbit".to_owned()),
        is_indirect: scenes::builtin_text(name).is_some_and(|text| text.contains(GLOBAL)),
        remark: OWN_REFERENCE.to_owned(),
    }
}

fn references(folder: &Path, work: &Path) -> io::Result<Vec<Case>> {
    let mut cases = Vec::new();
    let chains = folder.join("chains");
    if chains.join("ref.exr").is_file() {
        cases.push(Case {
            name: "chains-reference".to_owned(),
            scene: chains.join("chains.toml"),
            picture: Some(chains.join("ref.exr")),
            path: Some("move".to_owned()),
            is_indirect: false,
            remark: "Judged by a Mitsuba 3 picture of the same scene.".to_owned(),
        });
    }
    let rooms = folder.join("rooms");
    if rooms.join("ref_direct.exr").is_file() {
        cases.push(Case {
            name: "rooms-reference".to_owned(),
            scene: with_direct_light(&rooms, "rooms.toml", work)?,
            picture: Some(rooms.join("ref_direct.exr")),
            path: Some("move".to_owned()),
            is_indirect: false,
            remark: "Direct light only, judged by a Mitsuba 3 picture with direct light. The rivals' figures are for \
                     global illumination in the same scene."
                .to_owned(),
        });
    }
    Ok(cases)
}

/// A copy in `work` of a scene file, asking for direct light, naming its meshes by whole paths, and with a path `move` if
/// the scene has no path.
fn with_direct_light(folder: &Path, file: &str, work: &Path) -> io::Result<PathBuf> {
    let folder = folder.canonicalize()?;
    let mut text = fs::read_to_string(folder.join(file))?
        .replace("model = \"global\"", "model = \"direct\"")
        .replace("mesh = \"", &format!("mesh = \"{}/", folder.display()));
    if !text.contains("[[path]]") {
        let scene = scenes::load(&folder.join(file)).map_err(io::Error::other)?;
        text += &circle(&scene.camera);
    }
    let copy = work.join(format!("direct-{file}"));
    fs::write(&copy, text)?;
    Ok(copy)
}

/// A path in four seconds around where the camera stands, 0.3 m wide, looking where it looks.
fn circle(camera: &scenes::CameraSpec) -> String {
    let ([x, y, z], target) = (camera.eye, camera.target);
    let keys = (0..8).map(|i| {
        let (sin, cos) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
        let eye = [x + 0.3 * cos, y, z + 0.3 * sin];
        format!("  {{ eye = {eye:?}, target = {target:?} }},\n")
    });
    format!(
        "\n[[path]]\nname = \"move\"\nseconds = 4\nkeys = [\n{}]\n",
        keys.collect::<String>()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direct_copy_keeps_its_meshes() {
        let (folder, work) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let text = "[shading]\nmodel = \"global\"\n[[object]]\nmesh = \"a.obj\"\n[[path]]\nname = \"move\"\n";
        fs::write(folder.path().join("a.toml"), text).unwrap();
        let copy = with_direct_light(folder.path(), "a.toml", work.path()).unwrap();
        let text = fs::read_to_string(copy).unwrap();
        let mesh = folder.path().canonicalize().unwrap().join("a.obj");
        assert!(text.contains("model = \"direct\""));
        assert!(
            text.contains(&format!("mesh = \"{}\"", mesh.display())),
            "{text}"
        );
    }

    #[test]
    fn a_direct_copy_without_a_path_gets_one() {
        let (folder, work) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let text = "[camera]\neye = [0, 1, 4]\ntarget = [0, 1, 0]\n[shading]\nmodel = \"global\"\n\
                    [[object]]\nname = \"a\"\ngenerate = { kind = \"plane\", size = [2, 2] }\n";
        fs::write(folder.path().join("a.toml"), text).unwrap();
        let copy = with_direct_light(folder.path(), "a.toml", work.path()).unwrap();
        let paths = scenes::load(&copy).unwrap().paths;
        assert_eq!(paths.len(), 1);
        assert_eq!(paths[0].name, "move");
        let eye = paths[0].at_seconds(0.0).eye;
        assert!((eye[0] - 0.3).abs() < 1e-3 && (eye[2] - 4.0).abs() < 1e-3);
    }

    #[test]
    fn lights_shrink_to_points_of_the_same_power() {
        let text = "[[light]]\nname = \"a\"\nkind = \"area\"\n\
                    vertices = [[0, 3, 0], [0, 3, 2], [2, 3, 2], [2, 3, 0]]\nradiance = [1, 2, 3]\n\
                    [[object]]\nname = \"kind\"\ngenerate = { kind = \"plane\", size = [2, 2] }\n";
        let folder = tempfile::tempdir().unwrap();
        let load = |text: &str| {
            let file = folder.path().join("a.toml");
            fs::write(&file, text).unwrap();
            scenes::load(&file).unwrap().scene.lights
        };
        let lights = load(&with_point_lights(text, &load(text)));
        let [
            Light::Point {
                position,
                intensity,
            },
        ] = lights.as_slice()
        else {
            panic!("{lights:?}");
        };
        assert_eq!((*position, *intensity), ([1.0, 3.0, 1.0], [4.0, 8.0, 12.0]));
    }

    #[test]
    fn shadow_scenes_open() {
        let (folder, work) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let places = Places {
            checkout: folder.path().to_owned(),
            shared: None,
        };
        for case in with_shadows(&places, work.path(), false).unwrap() {
            let loaded = scenes::load(&case.scene).unwrap();
            assert!(loaded.path("orbit").is_some(), "{}", case.name);
            let is_point = |l: &Light| matches!(l, Light::Point { .. });
            let points = loaded.scene.lights.iter().all(is_point);
            assert_eq!(points, case.name == "chains-points");
        }
    }

    #[test]
    fn without_references_the_project_s_scenes_are_measured() {
        let folder = tempfile::tempdir().unwrap();
        let cases = references(folder.path(), folder.path()).unwrap();
        assert!(cases.is_empty());
        let rooms = own(Path::new("checkout"), "rooms");
        assert_eq!(rooms.scene, Path::new("checkout/scenes/rooms.toml"));
    }
}
