//! A client in another language, written from `PROTOCOL.md` alone, packs the same bytes.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::process::Command;

#[test]
fn the_python_client_agrees_with_the_document() {
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/python/edge_point_client.py"
    );
    match Command::new("python3")
        .args(["-B", script, "--self-test"])
        .output()
    {
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{said}");
        }
        Err(error) => println!("skipped: python3 cannot be run: {error}"),
    }
}
