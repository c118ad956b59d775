//! The laboratory's program.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    bowwave_lab::main()
}
