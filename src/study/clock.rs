//! CPU time: what equal time is measured in, since it does not depend on what else the machine does.

/// CPU time of this process so far, over all its threads, s.
pub fn cpu_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// The result of `f` and the CPU seconds that the process spent meanwhile.
pub fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = cpu_seconds();
    let value = f();
    (value, cpu_seconds() - start)
}
