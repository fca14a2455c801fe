//! The machine and the build that the figures belong to.

use super::{Lab, Section};
use crate::report::page::Block;
use crate::report::table::Table;

pub(super) const SECTION: Section = Section {
    name: "machine",
    title: "Machine and build",
    share: 0,
    measure,
};

fn measure(lab: &mut Lab) -> Vec<Block> {
    let machine = &lab.machine;
    let mut table = Table::new(
        "machine",
        "What these figures were measured on.",
        &["what", "value"],
    );
    table.row(["processor", &machine.cpu]);
    table.row(["logical processors", &machine.cores.to_string()]);
    if let Some(clock) = &machine.clock {
        table.row([
            "clock",
            &format!("{:.2} GHz ({})", clock.ghz, clock.derivation),
        ]);
    }
    if let Some(gib) = machine.memory_gib {
        table.row(["memory", &format!("{gib:.1} GiB")]);
    }
    table.row(["system", &machine.system]);
    table.row(["commit", &machine.commit]);
    table.row(["time, seconds since 1970", &machine.unix_time.to_string()]);
    vec![Block::Table(table)]
}
