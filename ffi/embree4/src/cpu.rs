//! The CPU: what it can do, against what was compiled in, and its treatment of subnormal numbers.

/// Sets flush-to-zero and denormals-are-zero for the calling thread, as every thread that traces rays should:
/// arithmetic on subnormal numbers is up to a hundred times slower, and none of ours needs them.
pub fn flush_denormals() {
    #[cfg(target_arch = "x86_64")]
    {
        const FLUSH_TO_ZERO: u32 = 1 << 15;
        const DENORMALS_ARE_ZERO: u32 = 1 << 6;
        let mut control = 0u32;
        // SAFETY: stores the control register into a local of its size, changes two bits and loads it back. No
        // exception is unmasked and rounding stays as it is; results differ only where one is subnormal, and
        // no code of ours relies on those.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut control, options(nostack, preserves_flags));
            control |= FLUSH_TO_ZERO | DENORMALS_ARE_ZERO;
            std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const control, options(nostack, preserves_flags));
        }
    }
    #[cfg(target_arch = "aarch64")]
    {
        const FLUSH_TO_ZERO: u64 = 1 << 24;
        let mut control: u64;
        // SAFETY: as above, for FPCR.FZ.
        unsafe {
            std::arch::asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags));
            control |= FLUSH_TO_ZERO;
            std::arch::asm!("msr fpcr, {}", in(reg) control, options(nostack, preserves_flags));
        }
    }
}

/// What the compiler may have used, by its name for it, and whether it was told to.
macro_rules! compiled_in {
    ($($feature:tt)*) => { [$(($feature, cfg!(target_feature = $feature))),*] };
}

/// Features that were compiled in (`target-cpu`) and that this CPU does not have: with any of them the program
/// would end with an illegal instruction sooner or later.
pub fn missing_features() -> Vec<&'static str> {
    let compiled = compiled_in!(
        "sse3" "ssse3" "sse4.1" "sse4.2" "popcnt" "avx" "f16c" "fma" "avx2" "bmi1" "bmi2" "lzcnt"
        "avx512f" "avx512dq" "avx512cd" "avx512bw" "avx512vl" "avx512vbmi" "avx512vnni"
    );
    compiled
        .into_iter()
        .filter(|&(feature, used)| used && !has(feature))
        .map(|(feature, _)| feature)
        .collect()
}

/// Whether this CPU and its system have `feature`; false for unknown names. Unlike `is_x86_feature_detected!` this
/// asks the CPU even where the compiler was told the answer.
#[cfg(target_arch = "x86_64")]
pub(crate) fn has(feature: &str) -> bool {
    let leaves = Leaves::read();
    let bit = |register: u32, bit: u32| register >> bit & 1 != 0;
    let avx = leaves.saves(0b110);
    let avx512 = leaves.saves(0b1110_0110);
    match feature {
        "sse2" => true,
        "sse3" => bit(leaves.l1_ecx, 0),
        "ssse3" => bit(leaves.l1_ecx, 9),
        "sse4.1" => bit(leaves.l1_ecx, 19),
        "sse4.2" => bit(leaves.l1_ecx, 20),
        "popcnt" => bit(leaves.l1_ecx, 23),
        "lzcnt" => bit(leaves.extended_ecx, 5),
        "bmi1" => bit(leaves.l7_ebx, 3),
        "bmi2" => bit(leaves.l7_ebx, 8),
        "avx" => avx && bit(leaves.l1_ecx, 28),
        "fma" => avx && bit(leaves.l1_ecx, 12),
        "f16c" => avx && bit(leaves.l1_ecx, 29),
        "avx2" => avx && bit(leaves.l7_ebx, 5),
        "avx512f" => avx512 && bit(leaves.l7_ebx, 16),
        "avx512dq" => avx512 && bit(leaves.l7_ebx, 17),
        "avx512cd" => avx512 && bit(leaves.l7_ebx, 28),
        "avx512bw" => avx512 && bit(leaves.l7_ebx, 30),
        "avx512vl" => avx512 && bit(leaves.l7_ebx, 31),
        "avx512vbmi" => avx512 && bit(leaves.l7_ecx, 1),
        "avx512vnni" => avx512 && bit(leaves.l7_ecx, 11),
        _ => false,
    }
}

/// Without x86 there is nothing to ask: the one instruction set is the base of the target.
#[cfg(not(target_arch = "x86_64"))]
pub(crate) fn has(_feature: &str) -> bool {
    false
}

/// The registers of `cpuid` that carry the features above.
#[cfg(target_arch = "x86_64")]
struct Leaves {
    l1_ecx: u32,
    l7_ebx: u32,
    l7_ecx: u32,
    extended_ecx: u32,
    /// XCR0: which registers the system saves on a switch of threads.
    saved: u64,
}

#[cfg(target_arch = "x86_64")]
impl Leaves {
    fn read() -> Self {
        use std::arch::x86_64::{__cpuid, __cpuid_count};
        // SAFETY: every x86-64 CPU has `cpuid`; a leaf above the highest one is not asked for.
        unsafe {
            let highest = __cpuid(0).eax;
            let l1_ecx = __cpuid(1).ecx;
            let l7 = (highest >= 7).then(|| __cpuid_count(7, 0));
            let extended = (__cpuid(0x8000_0000).eax >= 0x8000_0001).then(|| __cpuid(0x8000_0001));
            let has_xsave = l1_ecx >> 27 & 1 != 0;
            Self {
                l1_ecx,
                l7_ebx: l7.map_or(0, |l| l.ebx),
                l7_ecx: l7.map_or(0, |l| l.ecx),
                extended_ecx: extended.map_or(0, |l| l.ecx),
                saved: if has_xsave { xcr0() } else { 0 },
            }
        }
    }

    fn saves(&self, registers: u64) -> bool {
        self.saved & registers == registers
    }
}

/// The extended control register 0.
///
/// # Safety
///
/// The system has enabled XSAVE (`cpuid` leaf 1, ecx bit 27).
#[cfg(target_arch = "x86_64")]
unsafe fn xcr0() -> u64 {
    let (low, high): (u32, u32);
    // SAFETY: allowed by the promise above; reads a register.
    unsafe {
        std::arch::asm!("xgetbv", in("ecx") 0u32, out("eax") low, out("edx") high, options(nomem, nostack, preserves_flags));
    }
    u64::from(high) << 32 | u64::from(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_that_compiled_it_can_run_it() {
        assert_eq!(missing_features(), Vec::<&str>::new());
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn features_agree_with_the_standard_library() {
        macro_rules! same {
            ($($feature:tt)*) => { $(
                assert_eq!(has($feature), is_x86_feature_detected!($feature), "{}", $feature);
            )* };
        }
        same!(
            "sse3" "ssse3" "sse4.1" "sse4.2" "popcnt" "avx" "f16c" "fma" "avx2" "bmi1" "bmi2" "lzcnt"
            "avx512f" "avx512dq" "avx512cd" "avx512bw" "avx512vl" "avx512vbmi" "avx512vnni"
        );
        assert!(!has("no such feature"));
    }

    #[test]
    fn subnormals_are_flushed_in_the_thread_that_asked() {
        use std::hint::black_box;
        let halved = || black_box(black_box(f32::MIN_POSITIVE) * black_box(0.5));
        std::thread::spawn(move || {
            assert!(halved() > 0.0);
            flush_denormals();
            assert_eq!(halved(), 0.0);
            let subnormal = black_box(f32::from_bits(1));
            assert_eq!(black_box(subnormal * black_box(1e30)), 0.0);
        })
        .join()
        .expect("the assertions hold");
        assert!(halved() > 0.0, "other threads are as they were");
    }
}
