//! Building, finding and running the real binaries.

use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

use system_tests::places;
use tempfile::TempDir;

/// No run of these tests takes longer than this unless something hangs.
pub(crate) const LIMIT: Duration = Duration::from_secs(120);

/// Where the binaries are.
pub(crate) struct Binaries {
    pub(crate) renderer: PathBuf,
    pub(crate) shader_server: PathBuf,
    pub(crate) conformance: PathBuf,
}

/// The binaries of this test's own profile, brought up to date once: cargo names only a package's own binaries to its tests.
pub(crate) fn binaries() -> &'static Binaries {
    static BUILT: OnceLock<Binaries> = OnceLock::new();
    BUILT.get_or_init(|| {
        let own = std::env::current_exe().unwrap();
        let profile = own.ancestors().nth(2).unwrap();
        // The command is built apart, so that its features are not those of the others.
        for packages in [&["renderer", "shader-server"][..], &["protocol"]] {
            let mut build = Command::new(env!("CARGO"));
            build.args(["build", "--locked", "--quiet", "--target-dir"]);
            build
                .arg(profile.parent().unwrap())
                .args(packages.iter().flat_map(|package| ["-p", package]))
                .current_dir(places::checkout());
            if profile.ends_with("release") {
                build.arg("--release");
            }
            assert!(
                build.status().unwrap().success(),
                "the binaries cannot be built"
            );
        }
        let at = |name: &str| profile.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
        Binaries {
            renderer: at("renderer"),
            shader_server: at("shader-server"),
            conformance: at("conformance"),
        }
    })
}

/// What a process said and how it ended.
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Outcome {
    /// Itself, if the process ended well.
    #[track_caller]
    pub(crate) fn succeeded(self) -> Self {
        assert_eq!(
            self.code,
            Some(0),
            "stdout:\n{}\nstderr:\n{}",
            self.stdout,
            self.stderr
        );
        self
    }
}

/// A process that is ended when dropped, its output kept in files.
pub(crate) struct Running {
    child: Child,
    folder: TempDir,
    start: Instant,
}

impl Running {
    pub(crate) fn start(command: &mut Command) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = |name| fs::File::create(folder.path().join(name)).unwrap();
        let child = command
            .stdin(Stdio::null())
            .stdout(file("stdout"))
            .stderr(file("stderr"))
            .spawn()
            .unwrap();
        Self {
            child,
            folder,
            start: Instant::now(),
        }
    }

    /// Waits for the end; a process past the limit is ended and fails the test.
    #[track_caller]
    pub(crate) fn finish(mut self) -> Outcome {
        let text = |name| {
            let bytes = fs::read(self.folder.path().join(name)).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return Outcome {
                    code: status.code(),
                    stdout: text("stdout"),
                    stderr: text("stderr"),
                };
            }
            if self.start.elapsed() > LIMIT {
                panic!(
                    "it does not end\nstdout:\n{}\nstderr:\n{}",
                    text("stdout"),
                    text("stderr")
                );
            }
            sleep(Duration::from_millis(5));
        }
    }

    /// Waits for a line that begins with this, on either output, and gives the rest of it.
    #[track_caller]
    pub(crate) fn wait_for(&self, beginning: &str) -> String {
        loop {
            let texts = ["stdout", "stderr"].map(|name| {
                let bytes = fs::read(self.folder.path().join(name)).unwrap();
                String::from_utf8_lossy(&bytes).into_owned()
            });
            // A line that is not whole yet has no end.
            let whole = |line: &&str| line.ends_with('\n');
            let mut lines = texts
                .iter()
                .flat_map(|t| t.split_inclusive('\n').filter(whole));
            let found = lines.find_map(|line| Some(line.split_once(beginning)?.1));
            if let Some(rest) = found {
                return rest.trim_end().to_owned();
            }
            assert!(
                self.start.elapsed() < LIMIT,
                "it does not say {beginning:?}: {texts:?}"
            );
            sleep(Duration::from_millis(5));
        }
    }

    /// Whether it has not ended yet.
    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Its process id.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for the end, as [`Self::finish`]; gives the most memory that was seen in use too, KiB.
    #[track_caller]
    pub(crate) fn finish_with_peak(mut self) -> (Outcome, u64) {
        let mut peak = 0;
        while self.is_running() && self.start.elapsed() < LIMIT {
            peak = peak.max(peak_kib(self.id()));
            sleep(Duration::from_millis(5));
        }
        (self.finish(), peak)
    }
}

/// Most memory that a process ever had in use, KiB; 0 for one that has ended.
pub(crate) fn peak_kib(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.map_or(0, |text| {
        text.trim().trim_end_matches(" kB").parse().unwrap()
    })
}

/// Files and sockets that a process has open.
pub(crate) fn open_files(process: u32) -> usize {
    fs::read_dir(format!("/proc/{process}/fd")).unwrap().count()
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs the renderer to its end.
#[track_caller]
pub(crate) fn renderer<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Outcome {
    Running::start(Command::new(&binaries().renderer).args(args)).finish()
}

/// A shader server on a free port of loopback, ended when dropped.
pub(crate) struct ShaderServer {
    child: Child,
    pub(crate) address: String,
}

impl ShaderServer {
    pub(crate) fn start() -> Self {
        Self::start_at("127.0.0.1:0")
    }

    /// One that listens there.
    pub(crate) fn start_at(address: &str) -> Self {
        let mut child = Command::new(&binaries().shader_server)
            .args(["--listen", address, "--threads", "1"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let address = line
            .trim()
            .strip_prefix("listening on ")
            .unwrap_or_else(|| {
                panic!("the server's first line is {line:?}");
            });
        Self {
            address: address.to_owned(),
            child,
        }
    }

    /// Its process id.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has not ended yet.
    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Ends the process as a crash would.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for ShaderServer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const CUBE: &str = "v -1 0 -1\nv 1 0 -1\nv 1 2 -1\nv -1 2 -1\nv -1 0 1\nv 1 0 1\nv 1 2 1\nv -1 2 1\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n";
const FLOOR: &str = "v -6 0 -6\nv 6 0 -6\nv 6 0 6\nv -6 0 6\nf 4 3 2 1\n";
const SCENE: &str = r#"
[camera]
eye = [0, 3, 8]
target = [0, 1, 0]
up = [0, 1, 0]
fov_y = 45

[shading]
model = "direct"
ambient = [0.05, 0.05, 0.05]
background = [0.1, 0.2, 0.3]

[[light]]
kind = "area"
vertices = [[-1, 6, -1], [1, 6, -1], [1, 6, 1], [-1, 6, 1]]
radiance = [9, 9, 9]

[material.grey]
diffuse = [0.6, 0.6, 0.6]

[[object]]
name = "cube"
mesh = "cube.obj"
material = "grey"

[[object]]
name = "floor"
mesh = "floor.obj"
material = "grey"

[[path]]
name = "around"
seconds = 4
keys = [
  { eye = [0, 3, 8], target = [0, 1, 0] },
  { eye = [8, 3, 0], target = [0, 1, 0] },
  { eye = [0, 3, -8], target = [0, 1, 0] },
  { eye = [-8, 3, 0], target = [0, 1, 0] },
]
"#;

/// Paths of cube, lamp and camera of one name, to be added to [`small_scene`]'s file.
pub(crate) const ALL_MOVE: &str = "
[[path]]
name = 'all'
object = 'cube'
seconds = 1
keys = [{}, { translate = [1.5, 0.5, 1], rotate = [0, 40, 10] }]

[[path]]
name = 'all'
light = 0
seconds = 1
keys = [{}, { translate = [1, 0, 2], power = 0.5 }]

[[path]]
name = 'all'
seconds = 4
open = true
keys = [{ eye = [0, 3, 8], target = [0, 1, 0] }, { eye = [3, 3, 7], target = [0, 1, 0] }]
";

/// A fresh folder with a cube on a floor under an area light, and its scene file.
pub(crate) fn small_scene() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("cube.obj", CUBE),
        ("floor.obj", FLOOR),
        ("scene.toml", SCENE),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    let scene = folder.path().join("scene.toml");
    (folder, scene)
}

/// Arguments of `render` for a scene, written to `out` with statistics in `out`/stats.jsonl.
pub(crate) fn render_args(scene: &Path, out: &Path, more: &[&str]) -> Vec<String> {
    let stats = out.join("stats.jsonl");
    let fixed = [
        "render",
        scene.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
        "--size",
        "160x120",
        "--samples-per-frame",
        "400",
        "--stats",
        stats.to_str().unwrap(),
    ];
    fs::create_dir_all(out).unwrap();
    fixed.iter().chain(more).map(|s| (*s).to_owned()).collect()
}

/// Names and bytes of the frames in a folder, by name.
pub(crate) fn frames(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut frames: Vec<(String, Vec<u8>)> = entries
        .filter_map(|path| {
            let name = path.file_name()?.to_str()?.to_owned();
            name.starts_with("frame-")
                .then(|| (name, fs::read(&path).unwrap()))
        })
        .collect();
    frames.sort();
    frames
}

/// Lines of a statistics file so far; none while there is no file.
pub(crate) fn stats_lines(out: &Path) -> usize {
    fs::read_to_string(out.join("stats.jsonl")).map_or(0, |text| text.lines().count())
}

/// Waits until the statistics have this many lines; fails if the process ends or the limit passes first.
#[track_caller]
pub(crate) fn wait_for_frames(process: &mut Running, out: &Path, lines: usize) {
    let start = Instant::now();
    while stats_lines(out) < lines {
        assert!(
            process.is_running(),
            "it ended after {} frames",
            stats_lines(out)
        );
        assert!(
            start.elapsed() < LIMIT,
            "{} frames in {LIMIT:?}",
            stats_lines(out)
        );
        sleep(Duration::from_millis(5));
    }
}
