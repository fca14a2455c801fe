//! Loads a scene or mesh file and prints what is in it: `cargo run --release -p scenes --example inspect -- FILE...`

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

fn main() -> ExitCode {
    let mut failed = false;
    for name in std::env::args().skip(1) {
        let start = Instant::now();
        match scenes::load(Path::new(&name)) {
            Ok(loaded) => {
                let seconds = start.elapsed().as_secs_f64();
                println!("{name}: {:.3} s", seconds);
                let scene = &loaded.scene;
                println!(
                    "  {} objects, {} meshes, {} materials, {} textures, {} lights, {} paths",
                    scene.objects.len(),
                    scene.meshes.len(),
                    scene.materials.len(),
                    scene.textures.len(),
                    scene.lights.len(),
                    loaded.paths.len()
                );
                println!("  {}", loaded.report);
            }
            Err(e) => {
                eprintln!("{e}");
                failed = true;
            }
        }
    }
    // Linux alone tells the most memory that was used.
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        for line in status.lines().filter(|l| l.starts_with("VmHWM")) {
            println!("{line}");
        }
    }
    if failed {
        ExitCode::from(2)
    } else {
        ExitCode::SUCCESS
    }
}
