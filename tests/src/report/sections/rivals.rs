//! What a user would pick instead, from a table measured elsewhere.

use super::{Lab, Section};
use crate::report::page::Block;
use crate::report::rivals;

pub(super) const SECTION: Section = Section {
    name: "rivals",
    title: "What a user would pick instead",
    share: 0,
    measure,
};

fn measure(_lab: &mut Lab) -> Vec<Block> {
    let text = "These figures are not from this machine and hold for the independent references' scenes only; the charts \
                above show them only there.";
    vec![Block::Text(text.to_owned()), Block::Table(rivals::table())]
}
