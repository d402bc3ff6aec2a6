//! The command line: arguments become a typed job, the job's result an exit status (README, "Exit status").
//!
//! Every error is one line on stderr, `gdpt: error: what, where, what to do`; a panic is a bug of ours and says so
//! the same way.

mod analyze;
mod compare;
mod flags;
mod info;
mod progress;
mod reconstruct;
mod render;
mod signals;
mod statistics;
mod study;
mod terminal;

use crate::error::Error;
use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

/// Exit status of a bug.
const BUG: u8 = 70;

const EXAMPLES: &str = "\
Examples:
  gdpt render builtin:cornell-box -o cornell-box.exr -o cornell-box.png
  gdpt render scene.glb --env sky.exr --spp 256 --size 1920x1080 -o scene.exr
  gdpt compare test.exr reference.exr
  gdpt info scene.glb

Exit status: 0 done, 2 usage, 33 out of memory, 65 scene rejected, 66 input missing, 69 no usable Embree or CPU,
70 a bug, 73 output cannot be created, 74 I/O failed, 130/143 interrupted";

/// Gradient-domain path tracer on Embree, sixteen rays at a time.
#[derive(Parser)]
#[command(name = "gdpt", version, after_help = EXAMPLES, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene to an image
    Render(Box<flags::RenderFlags>),
    /// Solve for the image again from stored buffers, without rendering
    Reconstruct(reconstruct::Flags),
    /// Measure the error of an image against a reference
    Compare(compare::Flags),
    /// Say how noisy stored buffers are, what the theory expects, and where gradients pay
    Analyze(analyze::Flags),
    /// Measure path tracing against gradient-domain path tracing: one page with tables, curves and pictures
    Study(study::Flags),
    /// Say what is in a scene and what of it is honoured
    Info(info::Flags),
}

/// Runs the program with the process's arguments and says with which status to end.
pub fn main() -> ExitCode {
    let what = Arc::new(Mutex::new(String::new()));
    let seen = Arc::clone(&what);
    panic::set_hook(Box::new(move |panic| {
        let payload = panic.payload();
        let text = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
        let text = text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default();
        let place = panic.location().map(|l| format!(" ({}:{})", l.file(), l.line())).unwrap_or_default();
        *seen.lock().unwrap_or_else(PoisonError::into_inner) = format!("{text}{place}");
    }));
    match panic::catch_unwind(AssertUnwindSafe(|| run(std::env::args_os()))) {
        Ok(code) => ExitCode::from(code),
        Err(_) => {
            let what = what.lock().unwrap_or_else(PoisonError::into_inner);
            terminal::error(&format!("this is a bug, please report it: {what}"));
            ExitCode::from(BUG)
        }
    }
}

fn run(arguments: impl Iterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    let result = match cli.command {
        Command::Render(flags) => render::run(*flags),
        Command::Reconstruct(flags) => reconstruct::run(&flags),
        Command::Compare(flags) => compare::run(&flags),
        Command::Analyze(flags) => analyze::run(&flags),
        Command::Study(flags) => study::run(&flags),
        Command::Info(flags) => info::run(&flags),
    };
    match result {
        Ok(()) => 0,
        Err(error) => {
            terminal::error(&error.to_string());
            error.exit_code()
        }
    }
}

/// Help and version go to stdout; what is wrong with the arguments becomes one line.
fn refuse(error: &clap::Error) -> u8 {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            terminal::print(&error.render().to_string());
            return 0;
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            terminal::error("no command given; see gdpt --help");
        }
        _ => {
            let text = error.render().to_string();
            let lines = text.lines().take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more"));
            let words: Vec<&str> = lines.map(str::trim).filter(|l| !l.is_empty()).collect();
            let line = words.join(" ");
            terminal::error(&format!("{}; see --help", line.strip_prefix("error: ").unwrap_or(&line)));
        }
    }
    Error::Usage(String::new()).exit_code()
}
