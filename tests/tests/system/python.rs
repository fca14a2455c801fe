//! A client in another language, written from the protocol's document alone, against the real server.

use std::process::Command;

use system_tests::places;

use crate::support::{Running, ShaderServer};

fn client(argument: &str) {
    if Command::new("python3").arg("--version").output().is_err() {
        println!("skipped: python3 is not installed");
        return;
    }
    let script = places::checkout().join("tests/python/edge_point_client.py");
    let mut command = Command::new("python3");
    // Compiled modules would otherwise be left in the checkout.
    command.arg("-B").arg(script).arg(argument);
    Running::start(&mut command).finish().succeeded();
}

#[test]
fn the_python_client_gets_its_samples() {
    let server = ShaderServer::start();
    client(&server.address);
}

#[test]
fn the_python_client_packs_the_document_s_examples() {
    client("--self-test");
}
