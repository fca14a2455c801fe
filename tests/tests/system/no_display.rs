//! Without a display server the window command says so and renders to files.

use std::fs;
use std::process::Command;

use crate::support::{Running, binaries, frames, small_scene};

#[test]
fn the_window_command_renders_headless_and_says_so() {
    let (folder, scene) = small_scene();
    let out = folder.path().join("out");
    let mut command = Command::new(&binaries().renderer);
    command
        .arg(&scene)
        .arg("--out")
        .arg(&out)
        .args(["--size", "96x64"]);
    for variable in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(variable);
    }
    let outcome = Running::start(&mut command).finish().succeeded();
    let said = format!("{}{}", outcome.stdout, outcome.stderr);
    assert!(said.contains("display server"), "{said}");
    let frames = frames(&out);
    assert!(
        !frames.is_empty(),
        "no frames in {:?}",
        fs::read_dir(&out).map(Iterator::count)
    );
    assert!(
        frames
            .iter()
            .all(|(name, bytes)| name.ends_with(".png") && bytes.starts_with(b"\x89PNG"))
    );
}
