//! Widths that the data is laid out for.

/// Receivers a leaf, and samples an instruction.
pub(crate) const LANES: usize = 16;
/// Samples a group: a word of a mask.
pub(crate) const GROUP: usize = 32;
/// Least positive number: at least this is more than nothing.
pub(crate) const LEAST: f32 = f32::from_bits(1);

/// The bits that are set, from the lowest.
#[inline(always)]
pub(crate) fn bits(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if bits == 0 {
            return None;
        }
        let lane = bits.trailing_zeros() as usize;
        bits &= bits - 1;
        Some(lane)
    })
}
