//! The trainer's program.

fn main() -> std::process::ExitCode {
    bowwave::main()
}
