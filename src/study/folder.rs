//! The folder of a report: made where it is missing, tried before the work begins, gone again where the work failed
//! and left nothing in it.

use crate::error::{Error, Result};
use crate::store::atomic;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that files will be written into.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    created: bool,
}

impl Folder {
    /// Makes `path` if it is missing (its parent must exist) and finds out whether `files` can be written into it.
    pub fn prepare(path: &Path, files: &[&str], inputs: &[&Path]) -> Result<Self> {
        let refuse = |what: String| Error::Output { path: path.to_owned(), what };
        let created = match fs::create_dir(path) {
            Ok(()) => true,
            Err(_) if path.is_dir() => false,
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {
                return Err(refuse("is not a folder; choose another name".into()));
            }
            Err(e) => return Err(refuse(format!("the folder cannot be made: {e}"))),
        };
        let folder = Self { path: path.to_owned(), created };
        for file in files {
            atomic::probe(&path.join(file), inputs)?;
        }
        Ok(folder)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Only an empty folder can be removed: one with a report in it stays.
        if self.created {
            let _not_empty = fs::remove_dir(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_made_tried_and_gone_again_when_nothing_came_of_it() {
        let parent = tempfile::tempdir().expect("a private folder");
        let path = parent.path().join("report");
        drop(Folder::prepare(&path, &["a.csv"], &[]).expect("writable"));
        assert!(!path.exists());
        let folder = Folder::prepare(&path, &["a.csv"], &[]).expect("writable");
        fs::write(folder.path().join("a.csv"), "x").expect("writable");
        drop(folder);
        assert!(path.join("a.csv").exists());
        drop(Folder::prepare(&path, &["a.csv"], &[]).expect("an existing folder is used"));
        assert!(path.exists());
        let refused = Folder::prepare(&path.join("a.csv"), &["b"], &[]).expect_err("a file is no folder");
        assert_eq!(refused.exit_code(), 73);
        assert!(Folder::prepare(&parent.path().join("no/where"), &["b"], &[]).is_err());
    }
}
