//! Servers that dial in, servers behind a name, and secrets.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::support::{Running, binaries, frames, render_args, small_scene};

fn secret(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn display(scene: &Path, out: &Path, more: &[&str]) -> Running {
    let args = [&["--frames", "4", "--lockstep"], more].concat();
    Running::start(Command::new(&binaries().renderer).args(render_args(scene, out, &args)))
}

fn server(more: &[&str]) -> Running {
    let mut command = Command::new(&binaries().shader_server);
    Running::start(command.args(["--threads", "1"]).args(more))
}

#[test]
fn servers_dial_a_display_that_waits_for_them() {
    let (folder, scene) = small_scene();
    let key = secret(folder.path(), "key", "a secret of these tests\n");
    let other = secret(folder.path(), "other", "not what it should be\n");
    let alone = folder.path().join("alone");
    display(&scene, &alone, &[]).finish().succeeded();
    for (name, with) in [("open", None), ("secret", Some(&key))] {
        let out = folder.path().join(name);
        let own = with.map_or(vec![], |key| vec!["--secret-file", key.as_str()]);
        let args = [&["--accept", "127.0.0.1:0"], own.as_slice()].concat();
        let display = display(&scene, &out, &args);
        let address = display.wait_for("waiting for shader servers on ");
        let wrong = with.map(|_| server(&["--dial", &address, "--secret-file", &other]));
        if let Some(wrong) = &wrong {
            wrong.wait_for("no display at ");
        }
        let args = [&["--dial", &address], own.as_slice()].concat();
        let servers = [server(&args), server(&args)];
        assert_eq!(servers[0].wait_for("dialling "), address);
        display.finish().succeeded();
        assert_eq!(frames(&out), frames(&alone), "{name}");
    }
}

#[test]
fn a_name_and_a_secret_lead_to_a_server_and_neither_is_done_without() {
    let (folder, scene) = small_scene();
    let key = secret(folder.path(), "key", "a secret of these tests\r\n");
    let other = secret(folder.path(), "other", "not what it should be");
    let server = server(&["--listen", "127.0.0.1:0", "--secret-file", &key]);
    let address = server.wait_for("listening on ");
    let named = address.replace("127.0.0.1", "localhost");
    let run = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let args = [&["--connect", named.as_str()], more].concat();
        display(&scene, &out, &args).finish()
    };
    run("right", &["--secret-file", &key]).succeeded();
    let wrong = run("wrong", &["--secret-file", &other]);
    assert_eq!(wrong.code, Some(2), "{}", wrong.stderr);
    assert!(
        wrong.stderr.contains("the same --secret-file"),
        "{}",
        wrong.stderr
    );
    let without = run("without", &[]);
    assert_eq!(without.code, Some(2), "{}", without.stderr);
    assert!(
        without.stderr.contains("asks for a secret"),
        "{}",
        without.stderr
    );
    for text in [&wrong.stderr, &without.stderr] {
        assert!(
            !text.contains("of these tests") && !text.contains("should be"),
            "{text}"
        );
    }
    run("again", &["--secret-file", &key]).succeeded();
}

#[test]
fn a_secret_that_is_none_is_told() {
    let (folder, scene) = small_scene();
    let short = secret(folder.path(), "short", "0123\n");
    for file in [short.as_str(), "/no/such/file"] {
        let args = ["--secret-file", file];
        let outcome = display(&scene, &folder.path().join("out"), &args).finish();
        assert_eq!(outcome.code, Some(2));
        assert!(outcome.stderr.contains("secret file"), "{}", outcome.stderr);
        let outcome = server(&args).finish();
        assert_eq!(outcome.code, Some(2));
        assert!(outcome.stderr.contains("secret file"), "{}", outcome.stderr);
    }
    let far = server(&["--listen", "0.0.0.0:0"]).finish();
    assert_eq!(far.code, Some(2));
    assert!(far.stderr.contains("give --secret-file"), "{}", far.stderr);
}
