//! A budget of memory, bytes, shared by everything that one scene decodes.
//!
//! It counts what is kept and what is decoded on the way, without giving temporary memory back: an upper estimate
//! that a hostile file cannot pass, not a measurement.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that may still be allocated.
pub(super) struct Budget {
    total: u64,
    left: AtomicU64,
}

impl Budget {
    pub(super) fn new(total: u64) -> Self {
        Self { total, left: AtomicU64::new(total) }
    }

    /// Bytes left.
    pub(super) fn left(&self) -> u64 {
        self.left.load(Ordering::Relaxed)
    }

    /// Takes `bytes` for `what`, or says that the scene does not fit.
    pub(super) fn take(&self, bytes: u64, what: &str) -> Result<()> {
        let taken =
            self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes));
        taken.map(|_| ()).map_err(|left| {
            Error::OutOfMemory(format!(
                "{what} needs {}, of the scene's {} only {} are left: raise the memory limit or shrink the scene",
                mib(bytes),
                mib(self.total),
                mib(left)
            ))
        })
    }

    /// Takes `count` × `size` bytes.
    pub(super) fn take_array(&self, count: u64, size: u64, what: &str) -> Result<()> {
        self.take(count.saturating_mul(size), what)
    }
}

/// A size for people.
pub(super) fn mib(bytes: u64) -> String {
    let bytes = bytes as f64;
    if bytes < 1024.0 {
        format!("{bytes} B")
    } else if bytes < 1048576.0 {
        format!("{:.1} KiB", bytes / 1024.0)
    } else if bytes < 1073741824.0 {
        format!("{:.1} MiB", bytes / 1048576.0)
    } else {
        format!("{:.1} GiB", bytes / 1073741824.0)
    }
}
