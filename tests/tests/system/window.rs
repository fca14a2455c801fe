//! The window on a virtual screen. Skipped where Xvfb or xdotool is missing.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::support::{LIMIT, Running, ShaderServer, binaries, small_scene};

/// A screen of its own, ended when dropped.
struct Screen {
    server: Child,
    display: String,
}

impl Screen {
    /// Nothing, having said so, where there is no such program.
    fn start() -> Option<Self> {
        let there = |program: &str, arg: &str| {
            let run = Command::new(program)
                .arg(arg)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status();
            run.is_ok()
        };
        if !there("Xvfb", "-help") || !there("xdotool", "version") {
            println!("skipped: the window is tested only where Xvfb and xdotool are installed");
            return None;
        }
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "400x300x24"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap())
            .read_line(&mut number)
            .unwrap();
        Some(Self {
            server,
            display: format!(":{}", number.trim()),
        })
    }

    fn on<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command
            .env("DISPLAY", &self.display)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
    }

    /// Types keys into the window. What comes of it shows whether it worked: typing a key that closes the window fails.
    fn type_keys(&self, keys: &[&str]) {
        let mut typing = Command::new("xdotool");
        typing
            .args(["search", "--sync", "--name", "edge and point"])
            .args(["windowfocus", "--sync", "key", "--delay", "50"])
            .args(keys);
        let _ = self.on(&mut typing).stderr(Stdio::null()).status().unwrap();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Takes a screenshot again and again until one is as it should be.
#[track_caller]
fn wait_for_picture(screen: &Screen, out: &Path, good: impl Fn(&image::RgbImage) -> bool) {
    let start = Instant::now();
    loop {
        screen.type_keys(&["F12"]);
        sleep(Duration::from_millis(200));
        let shots = fs::read_dir(out).into_iter().flatten().flatten();
        let newest = shots
            .map(|entry| entry.path())
            .filter(|path| path.extension().is_some_and(|e| e == "png"))
            .max();
        // One that is being written is looked at the next time.
        if let Some(picture) = newest.and_then(|path| image::open(path).ok())
            && good(&picture.to_rgb8())
        {
            return;
        }
        assert!(start.elapsed() < LIMIT, "no screenshot is as it should be");
    }
}

#[test]
fn the_window_draws_outlives_its_server_and_closes() {
    let Some(screen) = Screen::start() else {
        return;
    };
    let (folder, scene) = small_scene();
    let out = folder.path().join("out");
    let mut server = ShaderServer::start();
    let mut command = Command::new(&binaries().renderer);
    command.args([&scene, Path::new("--out"), &out]).args([
        "--size",
        "160x120",
        "--connect",
        &server.address,
    ]);
    let mut window = Running::start(screen.on(&mut command));
    // The floor is lit: pixels near the bottom have a colour that came from the server.
    wait_for_picture(&screen, &out, |picture| {
        picture.dimensions() == (160, 120) && picture.get_pixel(80, 110).0 != [0; 3]
    });
    server.kill();
    // Edges need no server, and are yellow or magenta.
    screen.type_keys(&["2"]);
    wait_for_picture(&screen, &out, |picture| {
        picture.pixels().any(|p| p.0 == [0xff, 0xd8, 0])
    });
    assert!(window.is_running());
    screen.type_keys(&["Escape"]);
    window.finish().succeeded();
}
