//! The command line: one file a command.

mod align;
mod align_job;
mod clean;
mod completion;
mod config;
mod convert;
mod decode_video;
mod demo;
mod evaluate;
mod evaluate_home;
mod evaluate_track;
mod health;
mod inspect;
mod keys;
mod method;
mod migrate;
mod models;
mod networks;
mod openapi;
mod progress;
mod runtime;
mod serve;
mod service;
mod simulate;
mod store;
mod telemetry;
mod tenants;
mod video_tools;
mod work;
mod worker;

use clap::{CommandFactory, Parser, Subcommand};
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
    /// See it all at work: serve, upload a simulated home, compare the poses with the truth.
    Demo(demo::DemoArguments),
    /// Find the pose of one clip in a LiDAR map.
    Align(align::AlignArguments),
    /// Say what a file is, what was understood of it, and show a map.
    Inspect(inspect::InspectArguments),
    /// Write a map as Valetudo JSON, for ROS map_server, or as PLY.
    Convert(convert::ConvertArguments),
    /// Align the excerpts of a scene with known poses and print the errors.
    Evaluate(evaluate::EvaluateArguments),
    /// Make a furnished home with exact truth: LiDAR map, clips and a plan.
    Simulate(simulate::SimulateArguments),
    /// The networks: list them, fetch them, look at what one says of a picture.
    Models(models::ModelsArguments),
    /// Serve the HTTP API, with workers in the same process.
    Serve(serve::ServeArguments),
    /// Do jobs for servers that share a PostgreSQL database.
    Work(work::WorkArguments),
    /// Remove what killed processes left behind.
    Clean(clean::CleanArguments),
    /// Ask a running process whether it can serve.
    Health(health::HealthArguments),
    /// Make, list and revoke the keys of those who may call the service.
    Keys(keys::KeysArguments),
    /// List the tenants, and remove one with every byte of it.
    Tenants(tenants::TenantsArguments),
    /// Show the configuration that holds, where each value comes from, and the variables of the environment.
    ///
    /// A file of settings is given to any command as `--config FILE` or in VIOLA_CONFIG.
    Config(config::ConfigArguments),
    /// Bring the tables up to date without serving; `serve` and `work` do it too.
    Migrate(migrate::MigrateArguments),
    /// Decode frames of the video that is the standard input, for another process of viola.
    #[command(hide = true)]
    DecodeVideo(decode_video::DecodeVideoArguments),
    /// Align the clip of a job, for another process of viola.
    #[command(hide = true)]
    AlignJob(align_job::AlignJobArguments),
    /// Print the OpenAPI document of the service.
    Openapi,
}

/// Runs the command of the process's arguments; an error is printed with its causes.
pub fn main() -> ExitCode {
    crate::tls::use_ring();
    let program = Arguments::command();
    let arguments = match config::with_file(std::env::args_os(), &program) {
        Ok(arguments) => arguments,
        Err(error) => return failed(&error),
    };
    let done = match Arguments::parse_from(arguments).command {
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Align(arguments) => align::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Models(arguments) => models::run(&arguments),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Work(arguments) => work::run(&arguments),
        Command::Clean(arguments) => clean::run(&arguments),
        Command::Health(arguments) => health::run(&arguments),
        Command::Keys(arguments) => keys::run(&arguments),
        Command::Tenants(arguments) => tenants::run(&arguments),
        Command::Config(arguments) => config::run(&arguments, &program),
        Command::Migrate(arguments) => migrate::run(&arguments),
        Command::DecodeVideo(arguments) => decode_video::run(&arguments),
        Command::AlignJob(arguments) => align_job::run(&arguments),
        Command::Openapi => openapi::run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failed(&error),
    }
}

fn failed(error: &anyhow::Error) -> ExitCode {
    eprintln!("viola: {}", with_causes(error));
    ExitCode::FAILURE
}

/// An error and its causes in one line; a cause that the error already tells is not told again.
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
