use std::io::Write;

use super::*;

fn run<T>(work: impl Future<Output = T>) -> T {
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap()
        .block_on(work)
}

fn secret(text: &str) -> Secret {
    Secret::new(text.as_bytes())
}

/// Both sides on one pipe.
fn meet(
    accepting: (&str, Role),
    dialling: (&str, Role),
) -> (Result<(), SecretError>, Result<(), SecretError>) {
    run(async {
        let (mut a, mut b) = tokio::io::duplex(256);
        let accept = async {
            let end = accepted(&mut a, &secret(accepting.0), accepting.1).await;
            drop(a);
            end
        };
        let dial = async {
            let end = dialled(&mut b, &secret(dialling.0), dialling.1).await;
            drop(b);
            end
        };
        tokio::join!(accept, dial)
    })
}

#[test]
fn who_knows_the_secret_comes_in_whoever_dials() {
    use Role::{Display, ShaderServer};
    for (a, b) in [(Display, ShaderServer), (ShaderServer, Display)] {
        let (accept, dial) = meet(("one and the same", a), ("one and the same", b));
        accept.unwrap();
        dial.unwrap();
    }
}

#[test]
fn who_does_not_know_it_or_plays_the_same_part_stays_out() {
    use Role::{Display, ShaderServer};
    let other = meet(
        ("one secret of some", Display),
        ("another secret", ShaderServer),
    );
    assert!(matches!(other.0, Err(SecretError::Wrong)));
    assert!(
        matches!(other.1, Err(SecretError::Io(_))),
        "closed without a word"
    );
    let same = meet(("one and the same", Display), ("one and the same", Display));
    assert!(matches!(same.0, Err(SecretError::Wrong)));
}

#[test]
fn one_wrong_bit_anywhere_is_wrong() {
    for bit in 0..8 * (NONCE + TAG) {
        let end = run(async {
            let (mut a, mut b) = tokio::io::duplex(256);
            let key = secret("0123456789abcdef");
            let stranger = async {
                let mut greeting = [0; MAGIC.len() + NONCE];
                b.read_exact(&mut greeting).await.unwrap();
                let acceptor: Nonce = greeting[MAGIC.len()..].try_into().unwrap();
                let dialler = [7; NONCE];
                let mut answer = dialler.to_vec();
                answer.extend(key.tag(Role::Display, &acceptor, &dialler));
                answer[bit / 8] ^= 1 << (bit % 8);
                b.write_all(&answer).await.unwrap();
                // Nothing is told to a stranger.
                let mut told = Vec::new();
                b.read_to_end(&mut told).await.unwrap();
                assert!(told.is_empty());
            };
            let accept = async {
                let end = accepted(&mut a, &key, Role::ShaderServer).await;
                drop(a);
                end
            };
            tokio::join!(accept, stranger).0
        });
        assert!(matches!(end, Err(SecretError::Wrong)), "bit {bit}");
    }
}

#[test]
fn silence_and_strangers_are_told_apart() {
    let (silent, other) = run(async {
        let (mut a, _kept) = tokio::io::duplex(256);
        let silent = dialled(&mut a, &secret("0123456789abcdef"), Role::Display).await;
        let (mut a, mut b) = tokio::io::duplex(256);
        b.write_all(b"HTTP/1.1 400 Bad Request").await.unwrap();
        let other = dialled(&mut a, &secret("0123456789abcdef"), Role::Display).await;
        (silent, other)
    });
    assert!(matches!(silent, Err(SecretError::TimedOut)));
    assert!(matches!(other, Err(SecretError::NotAsked)));
}

#[test]
fn tags_are_those_of_the_document() {
    // HMAC-SHA256 by Python's hmac module: key b"0123456789abcdef", label, 32 bytes of 1, 32 bytes of 2.
    let tag = secret("0123456789abcdef").tag(Role::Display, &[1; 32], &[2; 32]);
    let hex: String = tag.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(
        hex,
        "26d404cd781cd3505a05943842f462a5ea1e4262175f04d88c2de8873373cfe6"
    );
    let tag = secret("0123456789abcdef").tag(Role::ShaderServer, &[1; 32], &[2; 32]);
    let hex: String = tag.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(
        hex,
        "0320efd7c4b52fafb8369bbbe8afe9d37472094255fe4bcfb11acf39a3faceb3"
    );
    let document = include_str!("../PROTOCOL.md");
    for role in [Role::Display, Role::ShaderServer] {
        let tag = secret("0123456789abcdef").tag(role, &[1; 32], &[2; 32]);
        let hex: String = tag.iter().map(|byte| format!("{byte:02x}")).collect();
        assert!(document.contains(&hex), "{hex}");
    }
}

#[test]
fn secret_files_are_read_without_their_line_break() {
    let folder = std::env::temp_dir().join(format!("edge-point-secret-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("secret");
    let read = |bytes: &[u8]| {
        File::create(&path).unwrap().write_all(bytes).unwrap();
        Secret::read(&path)
    };
    for end in ["", "\n", "\r\n"] {
        let file = read(format!("0123456789abcdef{end}").as_bytes()).unwrap();
        assert_eq!(file.key, b"0123456789abcdef");
        assert_eq!(format!("{file:?}"), "Secret", "it is never shown");
    }
    for bad in [&b"short\n"[..], &vec![b'x'; SECRET_BYTES[1] + 1]] {
        assert!(matches!(read(bad), Err(SecretFileError::Length { .. })));
    }
    assert!(read(&vec![b'x'; SECRET_BYTES[1]]).is_ok());
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(matches!(
        Secret::read(&path),
        Err(SecretFileError::Read { .. })
    ));
}
