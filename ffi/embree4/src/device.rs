//! Devices: typed configuration, read back; memory budget; version check.

use crate::error::{Error, Result, check};
use crate::{HEADERS_VERSION, cpu};
use embree4_sys as sys;
use std::ffi::{CString, c_void};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};

/// How a device is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceConfig {
    /// Threads that build acceleration structures; 0 = one a CPU.
    pub threads: usize,
    /// Highest instruction set to use; `None` = what the CPU and the library have.
    pub isa: Option<Isa>,
    /// Embree's own messages on standard output, 0 (none) to 3.
    pub verbose: u8,
    /// Most bytes Embree may hold at a time; `None` = no limit.
    pub max_memory: Option<u64>,
}

/// Instruction sets Embree can be limited to. Each gives its own hits, equal to the last bit on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    /// SSE2.
    Sse2,
    /// SSE4.2.
    Sse42,
    /// AVX.
    Avx,
    /// AVX2 with FMA.
    Avx2,
    /// AVX-512 (F, DQ, CD, BW, VL).
    Avx512,
}

impl Isa {
    /// All of them, ascending.
    pub const ALL: [Self; 5] = [Self::Sse2, Self::Sse42, Self::Avx, Self::Avx2, Self::Avx512];

    /// The name in Embree's configuration and on our command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sse2 => "sse2",
            Self::Sse42 => "sse4.2",
            Self::Avx => "avx",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// CPU features Embree needs for it.
    fn features(self) -> &'static [&'static str] {
        match self {
            Self::Sse2 => &["sse2"],
            Self::Sse42 => &["sse4.2"],
            Self::Avx => &["avx"],
            Self::Avx2 => &["avx2", "fma", "f16c", "bmi1", "bmi2", "lzcnt"],
            Self::Avx512 => &["avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl"],
        }
    }
}

impl FromStr for Isa {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|isa| isa.name() == name).ok_or_else(|| Error::UnknownIsa(name.into()))
    }
}

/// An Embree device. Clones share it; scenes keep it alive.
#[derive(Clone, Debug)]
pub struct Device(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    handle: sys::RTCDevice,
    monitor: Box<Monitor>,
}

// SAFETY: Embree's device functions may be called from any thread; the handle is only a reference to it, and the
// monitor is made of atomics.
unsafe impl Send for Inner {}
// SAFETY: as above.
unsafe impl Sync for Inner {}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: this is the one reference `rtcNewDevice` gave; scenes hold an `Arc` of this struct and are gone.
        // The monitor, which Embree still calls here, is freed after it.
        unsafe { sys::rtcReleaseDevice(self.handle) }
    }
}

/// Bytes Embree holds, against the budget.
#[derive(Debug)]
struct Monitor {
    used: AtomicI64,
    peak: AtomicI64,
    budget: i64,
}

impl Monitor {
    /// Embree announces (`!post`) or reports (`post`) a change of `bytes`; false refuses a growth. A refused
    /// announcement is never allocated, a refused report is freed and reported as a negative change.
    fn change(&self, bytes: i64, post: bool) -> bool {
        let used = self.used.fetch_add(bytes, Relaxed).saturating_add(bytes);
        if bytes > 0 && used > self.budget {
            if !post {
                self.used.fetch_sub(bytes, Relaxed);
            }
            return false;
        }
        self.peak.fetch_max(used, Relaxed);
        true
    }
}

/// What Embree calls; must not unwind, and cannot: it is atomic arithmetic.
///
/// # Safety
///
/// `monitor` is the live `Monitor` the device was given.
unsafe extern "C" fn on_memory(monitor: *mut c_void, bytes: isize, post: bool) -> bool {
    // SAFETY: by the promise above; only shared references to it exist.
    let monitor = unsafe { &*monitor.cast::<Monitor>() };
    monitor.change(bytes as i64, post)
}

impl Device {
    /// Makes a device and checks that it is what was asked for.
    pub fn new(config: DeviceConfig) -> Result<Self> {
        if let Some(isa) = config.isa
            && let Some(lacking) = isa.features().iter().find(|feature| !cpu::has(feature))
        {
            return Err(Error::UnsupportedCpu(format!("{} needs {lacking}", isa.name())));
        }
        let text = config_text(&config);
        let text = CString::new(text).expect("made of names and numbers, no NUL");
        // SAFETY: a valid C string, read during the call only.
        let handle = unsafe { sys::rtcNewDevice(text.as_ptr()) };
        if handle.is_null() {
            check(std::ptr::null_mut())?;
            return Err(Error::Embree("no device, and no reason given".into()));
        }
        let budget = config.max_memory.map_or(i64::MAX, |bytes| i64::try_from(bytes).unwrap_or(i64::MAX));
        let monitor = Box::new(Monitor { used: AtomicI64::new(0), peak: AtomicI64::new(0), budget });
        let device = Self(Arc::new(Inner { handle, monitor }));
        let monitor: *const Monitor = &*device.0.monitor;
        // SAFETY: the callback has the right type, and its argument is boxed and outlives the device (see `Drop`).
        unsafe { sys::rtcSetDeviceMemoryMonitorFunction(handle, Some(on_memory), monitor.cast_mut().cast()) }
        device.check()?;
        device.read_back(config.isa)?;
        Ok(device)
    }

    /// Checks version and capabilities of the library that was loaded.
    fn read_back(&self, isa: Option<Isa>) -> Result<()> {
        check_version(self.version(), HEADERS_VERSION)?;
        let yes = |property| self.property(property) != 0;
        if !yes(sys::RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) {
            return Err(Error::Missing("ray masks"));
        }
        if !yes(sys::RTC_DEVICE_PROPERTY_TRIANGLE_GEOMETRY_SUPPORTED) {
            return Err(Error::Missing("triangles"));
        }
        if yes(sys::RTC_DEVICE_PROPERTY_BACKFACE_CULLING_ENABLED) {
            return Err(Error::Missing("back faces (back-face culling is on)"));
        }
        // Embree ignores what it does not know; the packet widths it runs natively show what it uses.
        let Some(isa) = isa else { return Ok(()) };
        let native8 = yes(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED);
        let native16 = yes(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED);
        if (native8, native16) != (isa >= Isa::Avx, isa >= Isa::Avx512) {
            return Err(Error::Embree(format!("isa={} is not honoured by this library", isa.name())));
        }
        Ok(())
    }

    fn property(&self, property: sys::RTCDeviceProperty) -> isize {
        // SAFETY: the device is alive; an unknown property is an error code, not undefined.
        unsafe { sys::rtcGetDeviceProperty(self.0.handle, property) }
    }

    /// Version of the library: major, minor, patch.
    pub fn version(&self) -> [u32; 3] {
        let version = u32::try_from(self.property(sys::RTC_DEVICE_PROPERTY_VERSION)).unwrap_or(0);
        [version / 10_000, version / 100 % 100, version % 100]
    }

    /// The widest packet Embree traces natively with the instruction set in use: 4, 8 or 16.
    pub fn native_width(&self) -> usize {
        if self.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0 {
            16
        } else if self.property(sys::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0 {
            8
        } else {
            4
        }
    }

    /// Bytes Embree holds now.
    pub fn memory_used(&self) -> u64 {
        u64::try_from(self.0.monitor.used.load(Relaxed)).unwrap_or(0)
    }

    /// Most bytes Embree has held at a time.
    pub fn memory_peak(&self) -> u64 {
        u64::try_from(self.0.monitor.peak.load(Relaxed)).unwrap_or(0)
    }

    /// Takes the calling thread's error, if there is one.
    pub(crate) fn check(&self) -> Result<()> {
        check(self.0.handle)
    }

    pub(crate) fn handle(&self) -> sys::RTCDevice {
        self.0.handle
    }
}

fn config_text(config: &DeviceConfig) -> String {
    let mut text = format!("threads={},verbose={}", config.threads, config.verbose.min(3));
    if let Some(isa) = config.isa {
        text += ",isa=";
        text += isa.name();
    }
    text
}

/// The same major version, and not older than the headers.
fn check_version(library: [u32; 3], headers: [u32; 3]) -> Result<()> {
    if library[0] == headers[0] && library >= headers {
        return Ok(());
    }
    let dotted = |version: [u32; 3]| version.map(|part| part.to_string()).join(".");
    Err(Error::Version { library: dotted(library), headers: dotted(headers) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_instruction_sets_are_errors() {
        assert_eq!("bogus".parse::<Isa>(), Err(Error::UnknownIsa("bogus".into())));
        for isa in Isa::ALL {
            assert_eq!(isa.name().parse(), Ok(isa));
        }
    }

    #[test]
    fn instruction_sets_are_read_back() {
        for isa in Isa::ALL {
            let device = Device::new(DeviceConfig { isa: Some(isa), threads: 1, ..Default::default() });
            if isa.features().iter().all(|feature| cpu::has(feature)) {
                let width = [4, 4, 8, 8, 16][Isa::ALL.iter().position(|&i| i == isa).expect("in ALL")];
                assert_eq!(device.expect("the CPU has it").native_width(), width, "{}", isa.name());
            } else {
                assert!(matches!(device, Err(Error::UnsupportedCpu(_))), "{}", isa.name());
            }
        }
    }

    #[test]
    fn older_libraries_are_refused_and_newer_ones_of_the_same_major_are_not() {
        let headers = [4, 3, 3];
        for good in [[4, 3, 3], [4, 3, 4], [4, 4, 0], [4, 99, 0]] {
            assert_eq!(check_version(good, headers), Ok(()));
        }
        for bad in [[4, 3, 2], [4, 2, 9], [3, 13, 5], [5, 0, 0], [0, 0, 0]] {
            let text = check_version(bad, headers).expect_err("does not fit").to_string();
            assert!(text.contains("4.3.3") && !text.contains('\n'), "{text}");
        }
    }

    #[test]
    fn the_installed_library_fits_the_headers() {
        let device =
            Device::new(DeviceConfig { threads: 1, ..Default::default() }).expect("Embree is installed");
        assert!(device.version() >= HEADERS_VERSION);
    }

    #[test]
    fn errors_carry_embrees_words() {
        let device =
            Device::new(DeviceConfig { threads: 1, ..Default::default() }).expect("Embree is installed");
        // SAFETY: the device is alive; a null scene is an error that Embree detects.
        unsafe { sys::rtcCommitScene(std::ptr::null_mut()) }
        // The error of a call without a device belongs to no device.
        let text = check(std::ptr::null_mut()).expect_err("a null scene").to_string();
        assert!(text.len() > "Embree: ".len(), "{text}");
        assert_eq!(device.check(), Ok(()));
        assert_eq!(check(std::ptr::null_mut()), Ok(()), "taken");
    }
}
