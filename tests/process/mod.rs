//! What tests of the real program share: private folders, and what a failure looks like.

use std::fs;
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

/// A private folder, removed at the end.
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a private folder")
}

/// What it said.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asserts a failure with `status`, whose one line of error contains `words`.
pub fn assert_refused(output: &Output, status: i32, words: &[&str], what: &str) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(status), "{what}: {text}");
    let errors: Vec<&str> = text.lines().filter(|l| !l.starts_with("gdpt: warning: ")).collect();
    assert!(
        errors.len() == 1 && errors[0].starts_with("gdpt: error: "),
        "{what}: not one line of error: {text}"
    );
    for word in words {
        assert!(errors[0].contains(word), "{what}: {word:?} is not in {text}");
    }
}

/// Asserts that nothing half-written is left.
pub fn assert_no_hidden_files(folder: &Path) {
    for entry in fs::read_dir(folder).expect("the private folder") {
        let name = entry.expect("readable").file_name();
        assert!(!name.to_string_lossy().ends_with(".part"), "{name:?} was left behind");
    }
}
