//! The laboratory's program.

fn main() -> std::process::ExitCode {
    bowwave_lab::main()
}
