//! Lines for people. Nothing here can fail: a closed pipe ends the talking, not the work.

use std::io::Write;

/// Writes to stdout.
pub fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _closed_pipe = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// Writes one line to stderr.
pub fn line(text: &str) {
    let _closed_pipe = writeln!(std::io::stderr().lock(), "{text}");
}

/// Says why the program ends.
pub fn error(text: &str) {
    line(&format!("gdpt: error: {}", one_line(text)));
}

/// Says what the user should know.
pub fn warning(text: &str) {
    line(&format!("gdpt: warning: {}", one_line(text)));
}

/// Names out of files may hold anything; a message stays one line without control characters.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
