//! The command line: one file a command.

mod simulate;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Aligns RGB-D clips of a home to the LiDAR map of its robot vacuum.
#[derive(Parser)]
#[command(version, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Simulate(simulate::Arguments),
}

pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Simulate(arguments) => simulate::run(&arguments),
    }
}
