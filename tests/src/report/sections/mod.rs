//! What the report consists of, one module a section.

mod casting;
mod counts;
mod machine;
mod motion;
mod moves;
mod paper;
mod pictures;
mod rays;
mod rivals;
mod shadows;
mod stages;
mod still;
mod visibility;

use super::lab::Lab;
use super::page::Block;

/// A headed part of the report.
pub struct Section {
    /// Name for `--only`.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Its share of the time of a quick report, relative to the other sections'.
    pub share: u32,
    /// Measures it. What fails is put on the page as [`Block::Missing`].
    pub measure: fn(&mut Lab) -> Vec<Block>,
}

/// All sections in the order of the page.
pub const ALL: [Section; 13] = [
    machine::SECTION,
    still::SECTION,
    pictures::SECTION,
    motion::SECTION,
    shadows::SECTION,
    moves::SECTION,
    stages::SECTION,
    counts::SECTION,
    paper::SECTION,
    rays::SECTION,
    visibility::SECTION,
    casting::SECTION,
    rivals::SECTION,
];

/// The names that `--only` takes.
pub fn names() -> [&'static str; 13] {
    ALL.map(|section| section.name)
}

/// A number with so many digits after the point, or nothing.
fn cell(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(String::new, |v| format!("{v:.digits$}"))
}
