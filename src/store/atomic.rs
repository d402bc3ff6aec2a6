//! Files that are there whole or not at all: encode to memory, write to a hidden file in the same folder, flush it
//! to the disk, rename it over the old one, flush the folder.
//!
//! Whoever reads the path sees the old file or the complete new one. When anything fails the hidden file is removed
//! and the old one is untouched.

use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

fn refuse(path: &Path, what: impl Into<String>) -> Error {
    Error::Output { path: path.to_owned(), what: what.into() }
}

/// The folder of a path; `.` for a bare file name.
fn folder(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// An empty hidden file beside `path`, removed unless it is persisted.
fn hidden_file(path: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".gdpt-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Read and write for all, less the umask, as for any file a program creates.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder(path))
}

/// Finds out whether [`write()`] can succeed, before the work whose result it stores. `inputs` are files that must
/// not be overwritten.
pub fn probe(path: &Path, inputs: &[&Path]) -> Result<()> {
    if path.file_name().is_none() {
        return Err(refuse(path, "is not a file name"));
    }
    let folder = folder(path);
    if !folder.is_dir() {
        return Err(refuse(path, format!("there is no folder {}; create it first", folder.display())));
    }
    if let Ok(metadata) = fs::symlink_metadata(path) {
        let kind = metadata.file_type();
        if kind.is_dir() {
            return Err(refuse(path, "is a folder; name a file in it"));
        }
        if kind.is_symlink() {
            return Err(refuse(path, "is a symbolic link; name the file it points to"));
        }
        if !kind.is_file() {
            return Err(refuse(path, "is not a regular file"));
        }
        if metadata.permissions().readonly() {
            return Err(refuse(path, "exists and is read-only"));
        }
        let same = |input: &&Path| matches!((fs::canonicalize(input), fs::canonicalize(path)), (Ok(a), Ok(b)) if a == b);
        if inputs.iter().any(same) {
            return Err(refuse(path, "is an input; choose another name"));
        }
    }
    hidden_file(path).map(drop).map_err(|e| refuse(path, format!("cannot create a file here: {}", e.kind())))
}

/// Replaces the file at `path` by `bytes`, whole or not at all.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |source| Error::Io { path: path.to_owned(), source };
    // The kind alone: the text would name the hidden file.
    let mut file = hidden_file(path).map_err(|e| failed(e.kind().into()))?;
    file.as_file_mut().write_all(bytes).map_err(failed)?;
    if let Ok(old) = fs::metadata(path) {
        file.as_file().set_permissions(old.permissions()).map_err(failed)?;
    }
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    // The rename is on the disk once the folder is; where folders cannot be opened (not on Unix) it is the system's.
    if let Ok(directory) = File::open(folder(path)) {
        directory.sync_all().map_err(failed)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("the folder was created by the test");
        let mut names: Vec<_> =
            entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_the_old_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().expect("a private folder");
        let path = folder.path().join("a.exr");
        write(&path, b"old").expect("writable");
        write(&path, b"new and longer").expect("writable");
        assert_eq!(fs::read(&path).expect("written"), b"new and longer");
        assert_eq!(names(folder.path()), ["a.exr"]);
    }

    #[test]
    fn probe_says_what_is_wrong_and_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a private folder");
        let path = |name: &str| folder.path().join(name);
        let reason = |path: &Path, inputs: &[&Path]| match probe(path, inputs) {
            Err(Error::Output { what, .. }) => what,
            other => panic!("expected a refusal, got {other:?}"),
        };
        fs::write(path("scene.glb"), b"scene").expect("writable");
        assert!(reason(&path("none/a.exr"), &[]).contains("no folder"));
        assert!(reason(folder.path(), &[]).contains("is a folder"));
        assert!(reason(&path("./scene.glb"), &[&path("scene.glb")]).contains("is an input"));
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(path("scene.glb"), path("link")).expect("links work here");
            assert!(reason(&path("link"), &[]).contains("symbolic link"));
            fs::remove_file(path("link")).expect("created above");
        }
        probe(&path("a.exr"), &[&path("scene.glb")]).expect("a new file in a writable folder");
        assert_eq!(names(folder.path()), ["scene.glb"]);
    }
}
