//! The program; see [`gdpt::cli`].
#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    gdpt::cli::main()
}
