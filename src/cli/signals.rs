//! SIGINT and SIGTERM ask the work to stop and leave nothing half-written; the second one ends the process at once.

use crate::error::Error;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What arrived so far.
#[derive(Default)]
pub struct Signals {
    /// Whether to stop.
    pub cancel: Arc<AtomicBool>,
    number: Arc<AtomicUsize>,
}

impl Signals {
    /// Takes over the signals of this process.
    pub fn install() -> Result<Self, Error> {
        let signals = Self::default();
        signals.register().map_err(|e| Error::Usage(format!("cannot watch for signals: {e}")))?;
        Ok(signals)
    }

    fn register(&self) -> std::io::Result<()> {
        for signal in [SIGINT, SIGTERM] {
            // In this order: the first signal finds `cancel` false and passes; the second one ends the process.
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&self.cancel))?;
            flag::register_usize(signal, Arc::clone(&self.number), signal as usize)?;
            flag::register(signal, Arc::clone(&self.cancel))?;
        }
        // Where files have a size limit the write shall fail with a reason, not the process by a signal.
        #[cfg(unix)]
        flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
        Ok(())
    }

    /// Fills in which signal interrupted.
    pub fn name(&self, error: Error) -> Error {
        match error {
            Error::Interrupted(0) => Error::Interrupted(self.number.load(Ordering::Relaxed) as i32),
            other => other,
        }
    }
}
