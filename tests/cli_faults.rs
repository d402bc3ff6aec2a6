//! The program under a full disk, signals and closed pipes: the old files stay, the exit status tells.
#![cfg(unix)]

mod process;

use assert_cmd::cargo::cargo_bin;
use process::{assert_no_hidden_files, assert_refused, folder, stderr};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};

#[test]
fn a_full_disk_is_status_74_and_keeps_the_old_files() {
    let folder = folder();
    let path = folder.path();
    for (name, size) in [("old.exr", "64x64"), ("old.png", "8x8")] {
        fs::write(path.join(name), b"old").expect("writable");
        // No file may grow at all, as on a disk without a free block.
        let script = "ulimit -f 0; exec \"$0\" \"$@\"";
        let output = Command::new("sh")
            .current_dir(path)
            .args(["-c", script])
            .arg(cargo_bin!("gdpt"))
            .args(["render", "builtin:cornell-box", "--spp", "1", "--size", size, "-o", name, "-q"])
            .output()
            .expect("a shell");
        assert_refused(&output, 74, &[name], name);
        assert_eq!(fs::read(path.join(name)).expect("still there"), b"old");
    }
    assert_no_hidden_files(path);
}

#[test]
fn signals_end_it_and_write_nothing() {
    for (signal, status) in [("INT", 130), ("TERM", 143)] {
        let folder = folder();
        let path = folder.path();
        fs::write(path.join("old.exr"), b"old").expect("writable");
        let mut child = Command::new(cargo_bin!("gdpt"))
            .current_dir(path)
            .args(["render", "builtin:cornell-box", "-o", "old.exr", "--spp", "10000000"])
            .args(["--progress", "json"])
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("the program starts");
        let mut lines = BufReader::new(child.stderr.take().expect("piped"));
        let mut line = String::new();
        while !line.contains("\"render\"") {
            line.clear();
            assert!(lines.read_line(&mut line).expect("text") > 0, "it ended before it rendered");
        }
        let kill = Command::new("kill").arg(format!("-{signal}")).arg(child.id().to_string()).status();
        assert!(kill.expect("kill is there").success());
        let mut rest = String::new();
        lines.read_to_string(&mut rest).expect("text");
        let ended = child.wait().expect("it ends");
        assert_eq!((ended.code(), ended.signal()), (Some(status), None), "{rest}");
        assert!(rest.contains("gdpt: error: interrupted"), "{rest}");
        assert_eq!(fs::read(path.join("old.exr")).expect("still there"), b"old");
        assert_no_hidden_files(path);
    }
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let folder = folder();
    for arguments in [&["info", "builtin:cornell-box"][..], &["render", "--help"]] {
        let mut child = Command::new(cargo_bin!("gdpt"))
            .current_dir(folder.path())
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    }
}
