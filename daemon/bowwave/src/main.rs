//! The trainer's program.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    bowwave::main()
}
