//! Runs one kernel by name and prints the facts it knows, one a line: a number, a space, a name. Under callgrind this is
//! how instructions are counted; see `benches/ci.rs`.

use gdpt_bench::kernels::KERNELS;
use std::process::ExitCode;

fn main() -> ExitCode {
    let wanted = std::env::args().nth(1).unwrap_or_default();
    let Some(kernel) = KERNELS.iter().find(|kernel| kernel.name == wanted) else {
        eprintln!("usage: kernels NAME, one of:");
        KERNELS.iter().for_each(|kernel| eprintln!("    {}", kernel.name));
        return ExitCode::from(2);
    };
    for (name, value) in (kernel.run)() {
        println!("{value} {name}");
    }
    ExitCode::SUCCESS
}
