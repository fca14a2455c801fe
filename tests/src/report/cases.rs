//! The scenes that the report measures, and the pictures they are judged by.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

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
    /// What a reader must know to judge the figures.
    pub remark: String,
}

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

fn own(checkout: &Path, name: &str) -> Case {
    Case {
        name: name.to_owned(),
        scene: checkout.join(format!("scenes/{name}.toml")),
        picture: None,
        path: Some("orbit".to_owned()),
        remark: "Judged by the renderer's own reference method.".to_owned(),
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
    fn without_references_the_project_s_scenes_are_measured() {
        let folder = tempfile::tempdir().unwrap();
        let cases = references(folder.path(), folder.path()).unwrap();
        assert!(cases.is_empty());
        let rooms = own(Path::new("checkout"), "rooms");
        assert_eq!(rooms.scene, Path::new("checkout/scenes/rooms.toml"));
    }
}
