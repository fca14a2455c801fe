//! Pairing the frames of two folders by number.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::CompareError;

/// A range of frame numbers, its end not included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    /// The first frame.
    pub start: u64,
    /// One past the last frame.
    pub end: u64,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("{text:?} is no range of frames; write 30..60 (without 60) or 30..=60");
        let (start, end) = text.split_once("..").ok_or_else(wrong)?;
        let (end, extra) = end.strip_prefix('=').map_or((end, 0), |end| (end, 1));
        let start = start.parse().map_err(|_| wrong())?;
        let end = end
            .parse::<u64>()
            .map_err(|_| wrong())?
            .saturating_add(extra);
        if start < end {
            Ok(Self { start, end })
        } else {
            Err(wrong())
        }
    }
}

/// One frame to compare.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FramePair {
    /// The number in the file name.
    pub number: u64,
    /// The picture to judge.
    pub test: PathBuf,
    /// Its reference.
    pub reference: PathBuf,
}

/// Frames present in both folders (or in the one, where the other is a single picture) in ascending order.
/// An EXR is taken before a PNG of the same number where both sides have one.
///
/// # Errors
/// [`CompareError::Folder`] when a folder cannot be listed, [`CompareError::NoFrames`] when nothing matches.
pub fn pair_frames(
    test: &Path,
    reference: &Path,
    range: Option<FrameRange>,
) -> Result<Vec<FramePair>, CompareError> {
    let (tests, references) = (Source::list(test)?, Source::list(reference)?);
    let numbers: Vec<u64> = match (&tests, &references) {
        (Source::Folder(frames), _) | (_, Source::Folder(frames)) => {
            frames.keys().copied().collect()
        }
        _ => vec![0],
    };
    let in_range = |n: &u64| range.is_none_or(|r| (r.start..r.end).contains(n));
    let pairs: Vec<FramePair> = numbers
        .into_iter()
        .filter(in_range)
        .filter_map(|number| {
            let (test, reference) = tests.matching(&references, number)?;
            Some(FramePair {
                number,
                test,
                reference,
            })
        })
        .collect();
    if pairs.is_empty() {
        return Err(CompareError::NoFrames {
            test: test.into(),
            reference: reference.into(),
        });
    }
    Ok(pairs)
}

#[derive(Debug, Default)]
struct Formats {
    exr: Option<PathBuf>,
    png: Option<PathBuf>,
}

enum Source {
    Single(PathBuf),
    Folder(BTreeMap<u64, Formats>),
}

impl Source {
    fn list(path: &Path) -> Result<Self, CompareError> {
        let failed = |source| CompareError::Folder {
            path: path.to_owned(),
            source,
        };
        if !path.metadata().map_err(failed)?.is_dir() {
            return Ok(Self::Single(path.to_owned()));
        }
        let mut frames: BTreeMap<u64, Formats> = BTreeMap::new();
        for entry in std::fs::read_dir(path).map_err(failed)? {
            let file = entry.map_err(failed)?.path();
            let Some(number) = frame_number(&file) else {
                continue;
            };
            match file.extension().and_then(|e| e.to_str()) {
                Some("exr") => frames.entry(number).or_default().exr = Some(file),
                Some("png") => frames.entry(number).or_default().png = Some(file),
                _ => {}
            }
        }
        Ok(Self::Folder(frames))
    }

    fn formats(&self, number: u64) -> (Option<&Path>, Option<&Path>) {
        match self {
            Self::Single(path) => (Some(path), Some(path)),
            Self::Folder(frames) => frames
                .get(&number)
                .map_or((None, None), |f| (f.exr.as_deref(), f.png.as_deref())),
        }
    }

    fn matching(&self, other: &Self, number: u64) -> Option<(PathBuf, PathBuf)> {
        let ((a_exr, a_png), (b_exr, b_png)) = (self.formats(number), other.formats(number));
        let same = a_exr.zip(b_exr).or(a_png.zip(b_png));
        let (a, b) = same.or(a_exr.or(a_png).zip(b_exr.or(b_png)))?;
        Some((a.to_owned(), b.to_owned()))
    }
}

/// The digits at the end of a file's stem: 12 for `frame-0012.exr`.
fn frame_number(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_str()?;
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[stem.len() - digits..].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            std::fs::write(folder.path().join(file), b"").unwrap();
        }
        folder
    }

    #[test]
    fn ranges_parse_both_ways() {
        assert_eq!("30..60".parse(), Ok(FrameRange { start: 30, end: 60 }));
        assert_eq!("30..=60".parse(), Ok(FrameRange { start: 30, end: 61 }));
        for bad in ["60", "60..30", "a..b", "3..3", "..", "1..-2"] {
            assert!(bad.parse::<FrameRange>().is_err(), "{bad}");
        }
    }

    #[test]
    fn frames_pair_by_number_and_prefer_exr() {
        let a = folder(&[
            "frame-0000.png",
            "frame-0001.png",
            "frame-0001.exr",
            "stats.json",
        ]);
        let b = folder(&["frame-0001.exr", "frame-0001.png", "frame-0002.png"]);
        let pairs = pair_frames(a.path(), b.path(), None).unwrap();
        assert_eq!(pairs.len(), 1);
        assert_eq!(pairs[0].number, 1);
        assert_eq!(pairs[0].test, a.path().join("frame-0001.exr"));
        assert_eq!(pairs[0].reference, b.path().join("frame-0001.exr"));
    }

    #[test]
    fn one_reference_serves_every_frame_in_the_range() {
        let a = folder(&["frame-0008.exr", "frame-0009.exr", "frame-0010.exr"]);
        let b = folder(&["ref.exr"]);
        let reference = b.path().join("ref.exr");
        let range = Some(FrameRange { start: 9, end: 11 });
        let pairs = pair_frames(a.path(), &reference, range).unwrap();
        let numbers: Vec<u64> = pairs.iter().map(|p| p.number).collect();
        assert_eq!(numbers, [9, 10]);
        assert!(pairs.iter().all(|p| p.reference == reference));
    }

    #[test]
    fn nothing_in_common_is_an_error_with_both_names() {
        let (a, b) = (folder(&["frame-0000.png"]), folder(&["frame-0001.png"]));
        let message = pair_frames(a.path(), b.path(), None)
            .unwrap_err()
            .to_string();
        assert!(message.contains(a.path().to_str().unwrap()), "{message}");
    }
}
