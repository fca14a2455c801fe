//! Runs a plain loop compiled for the vector instructions that this machine has.
//!
//! The loops are ordinary safe Rust; only the choice of instruction set is made here. Rust never fuses or reorders
//! floating-point operations on its own, so every choice gives the same bits.

/// Work to run with the widest instruction set at hand. `run` and all that it calls should be `#[inline(always)]`,
/// so that its body is compiled inside the function that enables the instructions.
pub trait Kernel {
    /// What the work yields.
    type Output;
    /// Does the work.
    fn run(self) -> Self::Output;
}

/// Runs `kernel`, compiled for AVX2 where the processor has it and portably elsewhere.
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        if has_avx2() {
            #[expect(
                unsafe_code,
                reason = "the features that the callee enables were detected"
            )]
            // SAFETY: `has_avx2` says that the processor has every feature that `avx2` enables.
            return unsafe { avx2(kernel) };
        }
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}
