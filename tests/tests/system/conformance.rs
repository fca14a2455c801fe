//! The conformance command against the real server, the Python one, and servers that are broken on purpose.

use std::path::PathBuf;
use std::process::Command;

use system_tests::places;

use crate::support::{Outcome, Running, binaries};

fn python(script: &str) -> PathBuf {
    places::checkout().join("tests/python").join(script)
}

fn has_python() -> bool {
    let found = Command::new("python3").arg("--version").output().is_ok();
    if !found {
        println!("skipped: python3 is not installed");
    }
    found
}

fn conformance(args: &[&str]) -> Outcome {
    Running::start(Command::new(&binaries().conformance).args(args)).finish()
}

/// Checks a server that this starts. What is skipped is given, so that nothing is by accident.
#[track_caller]
fn passes(args: &[&str], skipped: &[&str]) {
    let outcome = conformance(args).succeeded();
    let lines = outcome.stdout.lines();
    let skips: Vec<&str> = lines
        .filter_map(|line| line.strip_prefix("skip "))
        .filter_map(|line| line.split(':').next())
        .collect();
    assert_eq!(skips, skipped, "{}", outcome.stdout);
}

#[test]
fn the_shader_server_conforms() {
    let server = binaries().shader_server.display().to_string();
    passes(
        &[
            "--quiet",
            "--timeout",
            "30",
            "--shader",
            &server,
            "--threads",
            "2",
        ],
        &["edits.unsupported"],
    );
}

#[test]
fn the_python_server_conforms() {
    if !has_python() {
        return;
    }
    let server = python("edge_point_server.py").display().to_string();
    passes(
        &["--quiet", "--timeout", "30", "--shader", &server],
        &["shading.textured", "edits.unsupported"],
    );
}

/// What is broken, and the check that has to say so.
const BROKEN: [(&str, &str); 47] = [
    ("hangs", "handshake.welcome"),
    ("other-version", "handshake.version-1-alone"),
    ("closes-without-fault", "handshake.hello-twice"),
    ("closes-without-fault", "malformed.empty-frame"),
    ("wrong-fault-code", "views.unknown"),
    ("stays-after-fault", "requests.before-scene"),
    ("answers-twice", "requests.answered-once"),
    ("loses-samples", "requests.answered-once"),
    ("off-the-ray", "requests.position-on-the-ray"),
    ("too-far", "requests.position-on-the-surface"),
    ("flat-pixels", "requests.position-on-the-ray"),
    ("wrong-object", "requests.object"),
    ("lights-are-objects", "requests.lights-seen"),
    ("too-dark", "shading.point-light"),
    ("too-dark", "shading.ambient-alone"),
    ("too-dark", "shading.background"),
    ("too-dark", "shading.area-light-seen"),
    ("light-leaks", "shading.in-shadow-ambient"),
    ("not-a-number", "requests.flags"),
    ("never-the-same", "requests.same-twice"),
    ("upside-down-maps", "shading.map"),
    ("flat-normals", "shading.normals"),
    ("late-triples", "triples.before-their-samples"),
    ("repeated-triples", "triples.once"),
    ("swapped-triples", "triples.true"),
    ("ignores-edits", "edits.object-moved"),
    ("ignores-edits", "edits.light-moved"),
    ("old-epochs", "edits.epoch-of-samples"),
    ("edits-what-is-held", "scene.held"),
    ("edits-what-is-held", "displays.edits-apart"),
    ("takes-any-epoch", "edits.epoch-skipped"),
    ("cancels-nothing", "cancels.nothing-older-after"),
    ("confirms-no-cancel", "cancels.confirmed"),
    ("keeps-credits", "cancels.credits-back"),
    ("no-credit-limit", "limits.credits"),
    ("forgets-views", "views.256-back"),
    ("remembers-views", "views.257-back"),
    ("no-value-checks", "scene.position-nan"),
    ("no-value-checks", "edits.transform-nan"),
    ("trusts-frames", "limits.frame-of-4-gib"),
    ("ignores-trailing-bytes", "malformed.bytes-after"),
    ("ignores-digests", "scene.other-digest"),
    ("pings-wait-their-turn", "pings.while-busy"),
    ("pings-wait-their-turn", "pings.while-building"),
    ("one-display-at-a-time", "displays.two"),
    ("one-message-a-read", "streams.byte-by-byte"),
    ("one-message-a-read", "streams.many-messages-at-once"),
];

/// What the command says of a broken server, if that is not what it should.
fn overlooked(kind: &str, check: &str) -> Option<String> {
    let server = python("broken_server.py").display().to_string();
    let outcome = conformance(&[
        "--quiet",
        "--timeout",
        "2",
        "--only",
        check,
        "--shader",
        &server,
        "--break",
        kind,
    ]);
    let told = outcome.stdout.contains(&format!("FAIL {check}: expected "));
    (outcome.code != Some(1) || !told).then(|| {
        let Outcome {
            code,
            stdout,
            stderr,
        } = outcome;
        format!("{kind}: {check}: {code:?}\n{stdout}{stderr}")
    })
}

#[test]
fn what_is_broken_is_told() {
    if !has_python() {
        return;
    }
    let overlooked: Vec<String> = BROKEN
        .iter()
        .filter_map(|(kind, check)| overlooked(kind, check))
        .collect();
    assert!(overlooked.is_empty(), "{}", overlooked.join("\n"));
}

#[test]
fn a_server_that_hangs_holds_nothing_up() {
    if !has_python() {
        return;
    }
    let server = python("broken_server.py").display().to_string();
    let outcome = conformance(&["--timeout", "0.5", "--shader", &server, "--break", "hangs"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.stdout);
    assert!(
        outcome
            .stdout
            .contains("FAIL handshake.welcome: expected Welcome; came nothing within 0.5 s"),
        "{}",
        outcome.stdout
    );
    assert!(!outcome.stdout.contains("pass "), "{}", outcome.stdout);
}

#[test]
fn what_the_user_can_mend_is_told() {
    // Nobody listens on this port of loopback: it is reserved and needs rights to be had.
    let outcome = conformance(&["--connect", "127.0.0.1:1"]);
    assert_eq!(outcome.code, Some(2));
    assert!(
        outcome
            .stderr
            .contains("cannot reach a server at 127.0.0.1:1")
    );
    for args in [
        &["--shader", "/nowhere/at-all"][..],
        &["--shader", "true"],
        &[],
    ] {
        assert_eq!(conformance(args).code, Some(2), "{args:?}");
    }
}
