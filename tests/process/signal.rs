//! The program under a signal.

use assert_cmd::cargo::cargo_bin;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

/// Starts the program in `folder`, with progress as JSON, and sends it `signal` once it says `stage`. Its exit status,
/// and what it said from then on.
pub fn signalled(folder: &Path, arguments: &[&str], stage: &str, signal: &str) -> (ExitStatus, String) {
    let mut child = Command::new(cargo_bin!("gdpt"))
        .current_dir(folder)
        .args(arguments)
        .args(["--progress", "json"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("piped"));
    let mut line = String::new();
    while !line.contains(stage) {
        line.clear();
        assert!(lines.read_line(&mut line).expect("text") > 0, "it ended before it rendered");
    }
    let kill = Command::new("kill").arg(format!("-{signal}")).arg(child.id().to_string()).status();
    assert!(kill.expect("kill is there").success());
    let mut rest = String::new();
    lines.read_to_string(&mut rest).expect("text");
    (child.wait().expect("it ends"), rest)
}
