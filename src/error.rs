//! The one error type. Each kind owns its exit status (see the README); each text is one line that says what is
//! wrong, where, and what to do.

use std::path::PathBuf;

/// Everything that can end a command early.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line asks for something that does not exist or contradicts itself.
    #[error("{0}")]
    Usage(String),
    /// Memory ran out, or would.
    #[error("out of memory: {0}")]
    OutOfMemory(String),
    /// The scene file was read and cannot be rendered; `at` is the place in it (JSON path, byte offset).
    #[error("{}: {at}{}{what}", path.display(), if at.is_empty() { "" } else { ": " })]
    Scene {
        /// The file.
        path: PathBuf,
        /// The place in it, or empty.
        at: String,
        /// What is wrong and what to do.
        what: String,
    },
    /// An input file is not there or cannot be read.
    #[error("{}: {what}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// Why it cannot be read.
        what: String,
    },
    /// No usable ray-tracing library or CPU.
    #[error("{0}")]
    Backend(String),
    /// The output cannot be created; found out before rendering.
    #[error("{}: {what}", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// Why it cannot be written.
        what: String,
    },
    /// Reading or writing failed midway.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Ended by a signal with nothing to resume.
    #[error("interrupted by signal {0}")]
    Interrupted(i32),
}

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// The exit status of the process.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::OutOfMemory(_) => 33,
            Self::Scene { .. } => 65,
            Self::Input { .. } => 66,
            Self::Backend(_) => 69,
            Self::Output { .. } => 73,
            Self::Io { .. } => 74,
            Self::Interrupted(signal) => (128 + *signal) as u8,
        }
    }
}
