//! A scene that is sent in pieces.

use protocol::transfer::{Assembler, EncodedScene};
use protocol::validate::validate_scene;
use protocol::{decode, scene::Scene};

use super::source::Source;
use super::world;

/// What is put together is what was cut up, or there is an error that says why not.
pub(super) fn transfer(data: &[u8]) {
    let mut source = Source::new(data);
    let lies = source.byte();
    let step = 1 + source.below(64);
    let skip = source.below(4) == 3;
    let bytes = match lies % 4 {
        0 => world::encoded().bytes(),
        _ => source.rest(),
    };
    let right = blake3::hash(bytes).into();
    let digest = if lies & 16 == 0 { right } else { [lies; 32] };
    let announced = match lies >> 5 {
        0..=3 => bytes.len() as u64,
        4 => bytes.len() as u64 + 1,
        5 => bytes.len() as u64 / 2,
        6 => 1 << 30,
        _ => u64::MAX,
    };
    let Ok(mut assembler) = Assembler::new(digest, announced, 1 << 30) else {
        assert!(announced > 1 << 30);
        return;
    };
    let mut sent = 0u64;
    for (index, piece) in bytes.chunks(step).enumerate() {
        if skip && index == 1 {
            continue;
        }
        match assembler.add(piece) {
            Ok(complete) => {
                sent += piece.len() as u64;
                assert!(sent <= announced && complete == (sent == announced));
            }
            Err(_) => {
                assert!(sent + piece.len() as u64 > announced);
                return;
            }
        }
    }
    let whole = sent == bytes.len() as u64;
    let Ok(scene) = assembler.finish() else {
        let good = decode::<Scene>(bytes).is_ok_and(|scene| validate_scene(&scene).is_ok());
        assert!(!(whole && digest == right && good), "a good scene is taken");
        return;
    };
    assert!(whole && digest == right);
    let again = EncodedScene::new(&scene).expect("what was taken can be sent");
    assert_eq!(again.bytes(), bytes);
}
