//! The program under a full disk, signals and closed pipes: the old files stay, the exit status tells.
#![cfg(unix)]

mod process;
#[path = "process/signal.rs"]
mod signal;

use assert_cmd::cargo::cargo_bin;
use process::{assert_no_hidden_files, assert_refused, folder, stderr};
use signal::signalled;
use std::fs;
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
        let arguments = ["render", "builtin:cornell-box", "-o", "old.exr", "--spp", "10000000"];
        let (ended, rest) = signalled(path, &arguments, "\"render\"", signal);
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
