//! The command line: commands, and the arguments that several of them share.

mod align;
mod args;
mod child;
mod clean;
mod config;
mod convert;
mod demo;
mod evaluate;
mod health;
mod inspect;
mod jobs;
mod keys;
mod map;
mod migrate;
mod models;
mod openapi;
mod output;
mod progress;
mod provenance;
mod serve;
mod service;
mod shell;
mod simulate;
mod sum;
mod surfaces;
mod telemetry;
mod tenants;
mod video_tools;
mod work;
mod wrong_file;

use anyhow::Result;
use clap::{CommandFactory, Parser, Subcommand};
use progress::Verbosity;
use std::process::ExitCode;

/// Aligns RGB-D clips of a home to the LiDAR map of its robot vacuum.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = EXIT_CODES)]
struct Arguments {
    /// Print no progress, only the result and errors.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Print each stage of the work, even without a terminal.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "Exit codes:
  0  done
  1  an error; standard error names it
  2  wrong arguments
  3  `align`: no pose can be given; `map`: a clip could not be read or has no pose";

#[derive(Subcommand)]
enum Command {
    /// Run a demonstration: serve, upload a simulated home, compare the poses with the truth.
    ///
    /// Of the networks in a models folder it uses the one for surfaces: simulated pictures are too plain for the others.
    Demo(demo::DemoArguments),
    /// Find the pose of one clip in a LiDAR map.
    #[command(after_help = align::EXIT_CODES)]
    Align(align::AlignArguments),
    /// Make the map of a home out of its clips and its LiDAR map, without a server.
    #[command(after_help = map::EXIT_CODES)]
    Map(map::MapArguments),
    /// Print the format and contents of a map or a clip, and sketch a map.
    Inspect(inspect::InspectArguments),
    /// Convert a map (to Valetudo, ROS map_server or PLY) or a clip (to Stray Scanner, TUM RGB-D or ScanNet).
    Convert(convert::ConvertArguments),
    /// Evaluate the method on data with known truth: a recorded scene, simulated homes or LiDAR maps.
    Evaluate(evaluate::EvaluateArguments),
    /// Simulate a furnished home: LiDAR maps, clips, a plan and the exact truth.
    Simulate(simulate::SimulateArguments),
    /// Write labelled surfaces of simulated clips, for training.
    Surfaces(surfaces::SurfacesArguments),
    /// List, fetch and check the neural networks.
    Models(models::ModelsArguments),
    /// Serve the HTTP API, with workers in the same process.
    #[command(after_help = config::HELP)]
    Serve(serve::ServeArguments),
    /// Run the jobs and send the webhooks of servers that share a PostgreSQL database.
    #[command(after_help = config::HELP)]
    Work(work::WorkArguments),
    /// Remove expired uploads and the files that killed processes left behind.
    #[command(after_help = config::HELP)]
    Clean(clean::CleanArguments),
    /// Check whether a running process can serve.
    Health(health::HealthArguments),
    /// Create, list and revoke the keys of the service.
    #[command(after_help = config::HELP)]
    Keys(keys::KeysArguments),
    /// List the clips whose jobs ended without an answer, and queue them again.
    #[command(after_help = config::HELP)]
    Jobs(jobs::JobsArguments),
    /// List the tenants, set the limits of one, or remove one with all its data.
    #[command(after_help = config::HELP)]
    Tenants(tenants::TenantsArguments),
    /// Show the effective configuration: each value, its source and its environment variable.
    ///
    /// Settings file: `--config FILE` or VIOLA_CONFIG, for serve, work, migrate, keys, jobs, tenants and clean.
    Config(config::ConfigArguments),
    /// Create or update the database tables without serving; `serve` and `work` do it too.
    #[command(after_help = config::HELP)]
    Migrate(migrate::MigrateArguments),
    /// Print the OpenAPI document of the service.
    Openapi,
    /// Print a shell's completions of this command line.
    Completions(shell::CompletionsArguments),
    /// Print the manual page, or write a page for each command.
    Man(shell::ManArguments),
}

/// Runs the command that the process's arguments name; prints an error with its causes.
pub fn main() -> ExitCode {
    viola_network::return_large_buffers();
    viola_storage::tls::use_ring();
    end_without_standard_output();
    let first = std::env::args_os().nth(1);
    if first.is_some_and(|name| child::has_command(&name.to_string_lossy())) {
        return child::run().map_or_else(|error| failed(&error), |()| ExitCode::SUCCESS);
    }
    let program = Arguments::command();
    let arguments = match config::with_file(std::env::args_os(), &program) {
        Ok(arguments) => arguments,
        Err(error) => return failed(&error),
    };
    let Arguments { quiet, verbose, command } = Arguments::parse_from(arguments);
    progress::set_verbosity(match (quiet, verbose) {
        (true, _) => Verbosity::Quiet,
        (_, true) => Verbosity::Verbose,
        _ => Verbosity::Normal,
    });
    run(command, &program).unwrap_or_else(|error| failed(&error))
}

fn run(command: Command, program: &clap::Command) -> Result<ExitCode> {
    match command {
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Align(arguments) => return align::run(&arguments),
        Command::Map(arguments) => return map::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Surfaces(arguments) => surfaces::run(&arguments),
        Command::Models(arguments) => models::run(&arguments),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Work(arguments) => work::run(&arguments),
        Command::Clean(arguments) => clean::run(&arguments),
        Command::Health(arguments) => health::run(&arguments),
        Command::Keys(arguments) => keys::run(&arguments),
        Command::Jobs(arguments) => jobs::run(&arguments),
        Command::Tenants(arguments) => tenants::run(&arguments),
        Command::Config(arguments) => config::run(&arguments, program),
        Command::Migrate(arguments) => migrate::run(&arguments),
        Command::Openapi => openapi::run(),
        Command::Completions(arguments) => shell::completions(&arguments, program),
        Command::Man(arguments) => shell::man(&arguments, program),
    }?;
    Ok(ExitCode::SUCCESS)
}

/// Ends the process if standard output cannot be written: without a message if nobody reads it any more, as after
/// `viola models list | head -1`.
fn end_without_standard_output() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        // The standard library's `println!` panics with this text.
        match panic.payload_as_str().and_then(|text| text.strip_prefix("failed printing to stdout: ")) {
            Some(cause) if cause.contains("Broken pipe") => std::process::exit(0),
            Some(cause) => {
                progress::to_standard_error(&format!("viola: cannot write to standard output: {cause}"));
                std::process::exit(1);
            }
            None => hook(panic),
        }
    }));
}

/// Prints an error and returns its exit code; clap's own errors end the process with theirs.
fn failed(error: &anyhow::Error) -> ExitCode {
    if let Some(error) = error.downcast_ref::<clap::Error>() {
        error.exit();
    }
    progress::to_standard_error(&format!("viola: {}", with_causes(error)));
    ExitCode::FAILURE
}

/// Returns an error and its causes in one line, without causes whose text the line already contains.
fn with_causes(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let text = cause.to_string();
        if !line.contains(&text) {
            line += if line.is_empty() { "" } else { ": " };
            line += &text;
        }
    }
    line
}
