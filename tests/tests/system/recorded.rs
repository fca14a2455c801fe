//! Recording sessions with the real binaries, and reading their traces.

use std::fs::File;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use protocol::trace::{Entry, Event, Header, Step, TraceReader, TraceWriter};
use protocol::{ToDisplay, decode};
use renderer::cli::{Cli, Command, ReplayArgs};
use renderer::traces::{Redrawn, ReplayError, draw};
use tempfile::TempDir;

use crate::support::{ALL_MOVE, Outcome, frames, renderer, small_scene};

/// The cube is pushed aside and stays there.
const PUSH: &str = "
[[path]]
name = 'push'
object = 'cube'
seconds = 0.26666
open = true
keys = [{}, { translate = [1.5, 0, 1] }]
";

/// A folder with a scene of things that move.
pub(crate) struct Place {
    pub(crate) folder: TempDir,
    pub(crate) scene: PathBuf,
}

impl Place {
    pub(crate) fn new() -> Self {
        let (folder, scene) = small_scene();
        let text = std::fs::read_to_string(&scene).unwrap();
        std::fs::write(&scene, text + PUSH + ALL_MOVE).unwrap();
        Self { folder, scene }
    }

    pub(crate) fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Arguments of `render` into `out`: small pictures of this place.
    pub(crate) fn render(&self, out: &Path, more: &str) -> Vec<String> {
        let mut fixed = "--size 64x48 --exr --seed 3".to_owned();
        if !more.contains("--samples-per-frame") {
            fixed += " --samples-per-frame 60";
        }
        let places = ["render", text(&self.scene), "--out", text(out)];
        let words = fixed.split_whitespace().chain(more.split_whitespace());
        places.into_iter().chain(words).map(str::to_owned).collect()
    }

    /// Records a run into NAME.trace, with its pictures in the folder NAME.
    #[track_caller]
    pub(crate) fn record(&self, name: &str, more: &str) -> PathBuf {
        let trace = self.at(&format!("{name}.trace"));
        let mut args = vec!["record".to_owned(), text(&trace).to_owned()];
        args.extend(self.render(&self.at(name), more));
        renderer(args).succeeded();
        trace
    }

    /// Draws a trace's pictures with the binary, into a folder of this name.
    pub(crate) fn replay(&self, trace: &Path, name: &str, more: &[&str]) -> Outcome {
        let out = self.at(name);
        let fixed = ["replay", text(trace), "--exr", "--out", text(&out)];
        renderer(fixed.iter().chain(more))
    }

    pub(crate) fn pictures(&self, name: &str) -> Vec<(String, Vec<u8>)> {
        frames(&self.at(name))
    }
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Draws a trace's pictures in this process.
pub(crate) fn redraw(trace: &Path, out: &Path, more: &[&str]) -> Result<Redrawn, ReplayError> {
    let fixed = ["renderer", "replay", text(trace), "--out", text(out)];
    let args: Box<ReplayArgs> = match clap::Parser::parse_from(fixed.iter().chain(more)) {
        Cli {
            command: Some(Command::Replay(args)),
            ..
        } => args,
        other => panic!("{other:?}"),
    };
    draw(trace, out, &args)
}

/// A trace's header and entries.
pub(crate) fn read(trace: &Path) -> (Header, Vec<Entry>) {
    let mut reader = TraceReader::new(File::open(trace).unwrap()).unwrap();
    let entries = std::iter::from_fn(|| reader.next_entry().unwrap()).collect();
    (reader.header().clone(), entries)
}

pub(crate) fn write(trace: &Path, header: &Header, entries: &[Entry]) {
    let mut writer = TraceWriter::new(File::create(trace).unwrap(), header).unwrap();
    for entry in entries {
        writer.write(entry.clone()).unwrap();
    }
}

/// Messages received in a trace, with the number of their entry and their connection.
pub(crate) fn received(entries: &[Entry]) -> Vec<(usize, u32, ToDisplay)> {
    let all = entries.iter().enumerate();
    all.filter_map(|(place, entry)| match &entry.event {
        Event::Received { connection, frame } => Some((place, *connection, decode(frame).unwrap())),
        _ => None,
    })
    .collect()
}

/// The steps in a trace, with the number of their entry.
pub(crate) fn steps(entries: &[Entry]) -> Vec<(usize, &Step)> {
    let all = entries.iter().enumerate();
    all.filter_map(|(place, entry)| match &entry.event {
        Event::Step(step) => Some((place, step)),
        _ => None,
    })
    .collect()
}

/// What becomes of what a server says.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fate {
    /// It arrives so much later.
    Late(Duration),
    /// The first connection ends after so many bytes.
    CutAfter(usize),
}

/// Stands between displays and a server.
pub(crate) struct Proxy {
    pub(crate) address: SocketAddr,
}

impl Proxy {
    /// Its threads end with the connections, and the last one with the process.
    pub(crate) fn start(server: &str, fate: Fate) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let server = server.to_owned();
        thread::spawn(move || {
            for (number, display) in listener.incoming().enumerate() {
                let (Ok(display), Ok(server)) = (display, TcpStream::connect(&server)) else {
                    return;
                };
                for stream in [&display, &server] {
                    stream.set_nodelay(true).unwrap();
                }
                let (from, to) = (display.try_clone().unwrap(), server.try_clone().unwrap());
                thread::spawn(move || pass(from, to, None));
                let fate = Some(fate).filter(|f| matches!(f, Fate::Late(_)) || number == 0);
                thread::spawn(move || pass(server, display, fate));
            }
        });
        Self { address }
    }
}

fn pass(mut from: TcpStream, mut to: TcpStream, fate: Option<Fate>) {
    let mut buffer = vec![0; 1 << 16];
    let mut passed = 0;
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        let mut count = count;
        match fate {
            Some(Fate::Late(by)) => thread::sleep(by),
            Some(Fate::CutAfter(most)) => count = count.min(most - passed),
            None => {}
        }
        passed += count;
        if to.write_all(&buffer[..count]).is_err() {
            break;
        }
        if matches!(fate, Some(Fate::CutAfter(most)) if passed == most) {
            let _ = from.shutdown(Shutdown::Both);
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}
