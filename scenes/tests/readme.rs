//! The README's examples load, and it names every key that the parser knows.

use std::fs;
use std::path::Path;

use scenes::load;

const README: &str = include_str!("../README.md");

fn load_text(dir: &Path, text: &str) -> Result<scenes::LoadedScene, scenes::SceneError> {
    let file = dir.join("scene.toml");
    fs::write(&file, text).expect("the folder can be written");
    load(&file)
}

#[test]
fn examples_load() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(
        dir.path().join("thing.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    )
    .unwrap();
    image::RgbImage::new(2, 3)
        .save(dir.path().join("picture.png"))
        .unwrap();
    let blocks: Vec<&str> = README
        .split("```toml\n")
        .skip(1)
        .filter_map(|rest| rest.split("```").next())
        .collect();
    assert_eq!(blocks.len(), 3);
    for block in blocks {
        let loaded = load_text(dir.path(), block).unwrap_or_else(|e| panic!("{e}\n{block}"));
        assert!(loaded.report.is_clean(), "{}", loaded.report);
    }
}

/// The names in "expected one of `a`, `b`".
fn names(error: &str) -> Vec<String> {
    let expected = error
        .split("expected")
        .nth(1)
        .unwrap_or_else(|| panic!("{error}"));
    let names: Vec<String> = expected
        .split('`')
        .skip(1)
        .step_by(2)
        .map(String::from)
        .collect();
    assert!(!names.is_empty(), "{error}");
    names
}

#[test]
fn every_key_is_documented() {
    let dir = tempfile::tempdir().unwrap();
    let expected = |text: &str| names(&load_text(dir.path(), text).unwrap_err().to_string());
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let words: Vec<&str> = README.split(|c| !is_word(c)).collect();
    let check =
        |name: &str, of: &str| assert!(words.contains(&name), "{name} of {of} is not in README.md");
    for table in [
        "zzz = 1",
        "[camera]\nzzz = 1",
        "[shading]\nzzz = 1",
        "[shading]\nmodel = 'zzz'",
        "[[light]]\nzzz = 1",
        "[[light]]\nkind = 'zzz'",
        "[material.a]\nzzz = 1",
        "[[object]]\nzzz = 1",
        "[[object]]\nname = 'a'\nnormals = 'zzz'",
        "[[path]]\nzzz = 1",
        "[[path]]\nname = 'a'\nseconds = 1\nkeys = [{ zzz = 1 }]",
    ] {
        expected(table).iter().for_each(|name| check(name, table));
    }
    let kinds = expected("[[object]]\nname = 'a'\ngenerate = { kind = 'zzz' }");
    assert!(kinds.len() >= 15);
    for kind in kinds {
        check(&kind, "generate");
        let table = format!("[[object]]\nname = 'a'\ngenerate = {{ kind = '{kind}', zzz = 1 }}");
        expected(&table).iter().for_each(|name| check(name, &table));
    }
}
