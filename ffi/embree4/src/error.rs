//! What Embree can refuse, with its own words where it has any.

use embree4_sys as sys;
use std::ffi::CStr;

/// Why a call failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Embree, or the memory budget of the device, refused an allocation.
    #[error("out of memory: {0}")]
    OutOfMemory(String),
    /// The CPU lacks what Embree, or the instruction set that was asked for, needs.
    #[error("unsupported CPU: {0}")]
    UnsupportedCpu(String),
    /// The library that was loaded does not fit the headers this program was compiled against.
    #[error("Embree {library} was loaded, but this program was built for {headers} or a later 4.x")]
    Version {
        /// Version of the library.
        library: String,
        /// Version of the headers.
        headers: String,
    },
    /// An instruction set of this name does not exist.
    #[error("unknown instruction set '{0}'; known are sse2, sse4.2, avx, avx2, avx512")]
    UnknownIsa(String),
    /// The library was built without something that is needed.
    #[error("Embree was built without {0}")]
    Missing(&'static str),
    /// An argument is out of range; found before Embree saw it.
    #[error("{0}")]
    Invalid(String),
    /// Any other error of Embree.
    #[error("Embree: {0}")]
    Embree(String),
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Takes the calling thread's error of `device` (null: of device creation), if there is one.
pub(crate) fn check(device: sys::RTCDevice) -> Result<()> {
    // SAFETY: `device` is null, which is allowed, or a live device: both callers hold it.
    let code = unsafe { sys::rtcGetDeviceError(device) };
    if code == sys::RTC_ERROR_NONE {
        return Ok(());
    }
    // SAFETY: as above; the text is copied before any other call.
    let text = unsafe { text_of(sys::last_error_message(device)) };
    let text = if text.is_empty() { format!("error code {code}") } else { text };
    Err(match code {
        sys::RTC_ERROR_OUT_OF_MEMORY => Error::OutOfMemory(text),
        sys::RTC_ERROR_UNSUPPORTED_CPU => Error::UnsupportedCpu(text),
        _ => Error::Embree(text),
    })
}

/// # Safety
///
/// `text` is null or a C string that lives during the call.
unsafe fn text_of(text: *const std::ffi::c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and a C string by the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}
