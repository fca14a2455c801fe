//! A connection that cuts what is sent where it likes, or holds it back to send it together.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::thread;
use std::time::Duration;

use crate::support::{ShaderServer, frames, render_args, renderer, small_scene};

/// How bytes go on.
#[derive(Clone, Copy)]
enum Cut {
    /// In pieces of these many bytes, over and over.
    Pieces(&'static [usize]),
    /// Together, once nothing has come for a moment or there is so much.
    Together(usize),
}

/// Listens, and passes what comes on to a server, cut; gives the address.
fn proxy(server: &str, cut: Cut) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = server.to_owned();
    // Ends with the test's process, at the latest.
    thread::spawn(move || {
        for near in listener.incoming() {
            let near = near.unwrap();
            let far = TcpStream::connect(&server).unwrap();
            for (from, to) in [(&near, &far), (&far, &near)] {
                let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                thread::spawn(move || pass(from, to, cut));
            }
        }
    });
    address
}

/// Until one of the two ends.
fn pass(mut from: TcpStream, mut to: TcpStream, cut: Cut) {
    to.set_nodelay(true).unwrap();
    let _ = match cut {
        Cut::Pieces(lengths) => pieces(&mut from, &mut to, lengths),
        Cut::Together(most) => together(&mut from, &mut to, most),
    };
    let _ = to.shutdown(Shutdown::Both);
    let _ = from.shutdown(Shutdown::Both);
}

fn pieces(from: &mut TcpStream, to: &mut TcpStream, lengths: &[usize]) -> std::io::Result<()> {
    let mut buffer = [0; 4096];
    let mut lengths = lengths.iter().cycle();
    loop {
        let mut rest = match from.read(&mut buffer)? {
            0 => return Ok(()),
            count => &buffer[..count],
        };
        while !rest.is_empty() {
            let length = lengths.next().map_or(1, |length| *length).min(rest.len());
            to.write_all(&rest[..length])?;
            rest = &rest[length..];
        }
    }
}

fn together(from: &mut TcpStream, to: &mut TcpStream, most: usize) -> std::io::Result<()> {
    from.set_read_timeout(Some(Duration::from_millis(2)))?;
    let mut held = Vec::new();
    let mut buffer = [0; 4096];
    loop {
        match from.read(&mut buffer) {
            Ok(0) => return to.write_all(&held),
            Ok(count) => held.extend_from_slice(&buffer[..count]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                to.write_all(&held)?;
                held.clear();
            }
            Err(error) => return Err(error),
        }
        if held.len() >= most {
            to.write_all(&held)?;
            held.clear();
        }
    }
}

fn render(scene: &Path, out: &Path, server: &str) -> Vec<(String, Vec<u8>)> {
    let args = [
        "--path",
        "around",
        "--frames",
        "4",
        "--lockstep",
        "--exr",
        "--connect",
        server,
    ];
    renderer(render_args(scene, out, &args)).succeeded();
    frames(out)
}

#[test]
fn pictures_do_not_depend_on_how_a_stream_is_cut() {
    let (folder, scene) = small_scene();
    let server = ShaderServer::start();
    let whole = render(&scene, &folder.path().join("whole"), &server.address);
    assert_eq!(whole.len(), 8);
    let cuts = [
        ("bytes", Cut::Pieces(&[1])),
        ("odd", Cut::Pieces(&[3, 1, 17, 4, 2])),
        ("headers", Cut::Pieces(&[4, 1000])),
        ("together", Cut::Together(1 << 20)),
    ];
    for (name, cut) in cuts {
        let through = proxy(&server.address, cut);
        let pictures = render(&scene, &folder.path().join(name), &through);
        assert!(pictures == whole, "{name}: other pictures");
    }
}
