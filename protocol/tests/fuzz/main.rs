//! A bounded share of what cargo-fuzz does (see `fuzz/` beside this folder), on any toolchain: inputs kept from before,
//! changed at random in the ways that break parsers, and random ones.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod bodies;
#[path = "../counting/mod.rs"]
mod counting;
mod mutation;

use std::fs;
use std::path::{Path, PathBuf};

use bodies::{TARGETS, Target, bounded};
use mutation::Mutator;

/// Inputs of each target.
const INPUTS: usize = 300_000;

fn corpus(target: &Target) -> Vec<Vec<u8>> {
    let folder = folder(target);
    let mut files: Vec<PathBuf> = fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

fn folder(target: &Target) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/seeds")
        .join(target.name)
}

/// Every input that was kept, then changed ones. The input that fails is written where it can be tried again.
fn attack(target: &Target) {
    let seeds = corpus(target);
    assert!(!seeds.is_empty(), "{} has no seeds", target.name);
    for seed in &seeds {
        attempt(target, seed);
    }
    let mut mutator = Mutator::new(0x5eed, &seeds);
    for _ in 0..INPUTS {
        attempt(target, mutator.next());
    }
}

fn attempt(target: &Target, input: &[u8]) {
    let tried = std::panic::catch_unwind(|| bounded(target, input));
    if let Err(panic) = tried {
        let file = std::env::temp_dir().join(format!("fuzz-{}", target.name));
        fs::write(&file, input).unwrap();
        eprintln!("the input is in {}", file.display());
        std::panic::resume_unwind(panic);
    }
}

macro_rules! attacks {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            let name = stringify!($name);
            attack(TARGETS.iter().find(|target| target.name == name).unwrap());
        })*

        #[test]
        fn no_target_is_forgotten() {
            let tried = [$(stringify!($name)),*];
            assert_eq!(TARGETS.map(|target| target.name), tried);
        }
    };
}

attacks! {
    to_server to_display scene stream transfer server_session display_session conversation secret trace
    trace_checked
}
