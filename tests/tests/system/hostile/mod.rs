//! Peers that break the rules, lie, stall, flood and vanish, against the real binaries.

mod cut;
mod death;
mod display;
mod fake;
mod flood;
mod server;
mod wire;
mod wrong;
