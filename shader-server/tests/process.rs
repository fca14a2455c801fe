//! The program itself.
#![allow(clippy::unwrap_used)]

use std::{
    io::{BufRead, BufReader, Read},
    net::{SocketAddr, TcpStream},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

fn program(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shader-server"));
    command
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

fn exit_code(mut child: Child) -> (Option<i32>, String) {
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let mut text = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut text)
        .unwrap();
    (status.code(), text)
}

#[test]
fn it_says_where_it_listens_and_ends_with_its_parent() {
    let mut child = program(&["--threads", "1", "--parent-stdin"])
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let address = line.strip_prefix("listening on ").unwrap().trim();
    let address: SocketAddr = address.parse().unwrap();
    assert!(address.ip().is_loopback() && address.port() != 0);
    let connected = TcpStream::connect(address).unwrap();
    drop(child.stdin.take());
    assert_eq!(exit_code(child).0, Some(0));
    drop(connected);
}

#[test]
fn what_the_user_can_mend_has_code_2() {
    for (args, expected) in [
        (["--listen", "0.0.0.0:0"], "not a loopback address"),
        (["--shadows", "maps"], "invalid value"),
        (["--listen", "127.0.0.1:99999"], "invalid value"),
    ] {
        let (code, text) = exit_code(program(&args).spawn().unwrap());
        assert_eq!(code, Some(2), "{args:?}: {text}");
        assert!(text.contains(expected), "{args:?}: {text}");
    }
}

#[test]
fn a_taken_port_is_reported() {
    let holder = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = holder.local_addr().unwrap().to_string();
    let (code, text) = exit_code(program(&["--listen", &address]).spawn().unwrap());
    assert_eq!(code, Some(2));
    assert!(
        text.contains(&address) && text.lines().count() == 1,
        "{text}"
    );
}
