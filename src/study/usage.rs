//! What this process uses. CPU time is what equal time is measured in, since it does not depend on what else the machine
//! does; memory is what the system says.

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

/// Most memory this process ever held, bytes; none where the system does not say. Not `ru_maxrss`, which a process
/// inherits from the one that started it.
pub fn peak_memory() -> Option<u64> {
    status_bytes("VmHWM:")
}

/// Memory this process holds, bytes; none where the system does not say.
pub fn resident_memory() -> Option<u64> {
    status_bytes("VmRSS:")
}

fn status_bytes(field: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(field))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
