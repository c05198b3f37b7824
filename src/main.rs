//! The `viola` binary: parse the arguments, call one command.

fn main() -> std::process::ExitCode {
    viola::cli::main()
}
