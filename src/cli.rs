//! The command line: one file a command.

mod migrate;
mod openapi;
mod serve;

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
    Serve(serve::Serve),
    Migrate(migrate::Migrate),
    Openapi(openapi::Openapi),
}

pub fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Serve(serve) => serve.run(),
        Command::Migrate(migrate) => migrate.run(),
        Command::Openapi(openapi) => openapi.run(),
    }
}

/// Tells a person on the terminal what went wrong.
fn fail(error: &dyn std::error::Error) -> ExitCode {
    eprintln!("viola: {error}");
    ExitCode::FAILURE
}
