//! Asking for memory before it is needed: trees of large meshes do not fit into caches.

/// Bytes fetched at once.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Begins to bring `item` into the cache, on processors where this is known to pay; changes nothing else.
#[inline(always)]
#[cfg_attr(
    target_arch = "x86_64",
    expect(
        unsafe_code,
        reason = "a prefetch takes a pointer but never reads through it"
    )
)]
pub(crate) fn prefetch<T>(item: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = std::ptr::from_ref(item).cast::<i8>();
        for line in 0..size_of::<T>().div_ceil(LINE) {
            // SAFETY: a prefetch has no effect that a program can see, whatever the address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line * LINE)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = item;
}
