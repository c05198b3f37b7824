//! `viola models`: lists, fetches and checks the neural networks.

mod archive;
mod check;
mod download;
mod drawing;
mod fetch;
mod sum;
mod timed;

use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use viola_network::manifest::{Manifest, ModelEntry, Source, Task};

#[derive(Args)]
pub struct ModelsArguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// List the known networks and whether they are installed.
    List {
        #[command(flatten)]
        folder: Folder,
    },
    /// Fetch a network, or the runtime library, into the models folder.
    Fetch {
        /// Name from `viola models list`.
        name: String,
        #[command(flatten)]
        folder: Folder,
    },
    /// Run a network on a picture and draw its output.
    Check(check::CheckArguments),
}

#[derive(Args, Debug, Clone)]
struct Folder {
    /// Models folder.
    #[arg(long, env = "VIOLA_MODELS", default_value = "viola-models", value_name = "DIR")]
    models: PathBuf,
}

impl Folder {
    fn manifest(&self) -> Result<Manifest> {
        Manifest::with_folder(&self.models)
            .with_context(|| format!("models folder {}", self.models.display()))
    }
}

pub fn run(arguments: &ModelsArguments) -> Result<()> {
    match &arguments.command {
        Command::List { folder } => list(folder),
        Command::Fetch { name, folder } => fetch::run(find(&folder.manifest()?, name)?, &folder.models),
        Command::Check(arguments) => check::run(arguments),
    }
}

fn find<'m>(manifest: &'m Manifest, name: &str) -> Result<&'m ModelEntry> {
    manifest.find(name).with_context(|| {
        let names: Vec<&str> = manifest.networks.iter().map(|entry| entry.name.as_str()).collect();
        format!("there is no network '{name}'; there are {}", names.join(", "))
    })
}

fn list(folder: &Folder) -> Result<()> {
    let manifest = folder.manifest()?;
    let mut rows = vec![["name", "task", "size", "installed", "sum", "licence"].map(str::to_owned)];
    for entry in &manifest.networks {
        let state = State::of(entry, &folder.models)?;
        rows.push([
            entry.name.clone(),
            task(entry.task).to_owned(),
            state.bytes.map_or("-".to_owned(), |bytes| format!("{:.1} MB", bytes as f64 / 1e6)),
            if state.bytes.is_some() { "yes" } else { "no" }.to_owned(),
            state.sum.to_owned(),
            entry.licence.clone(),
        ]);
    }
    let widths: Vec<usize> =
        (0..5).map(|c| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0)).collect();
    for row in &rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        println!("{}  {}", cells.join("  "), row[5]);
    }
    for entry in &manifest.networks {
        if let Source::Export { how } = &entry.source
            && !entry.path(&folder.models).is_file()
        {
            println!("\n{}: {how}", entry.name);
        }
    }
    Ok(())
}

fn task(task: Task) -> &'static str {
    match task {
        Task::Segmentation => "segmentation",
        Task::Depth => "depth",
        Task::Inpainting => "inpainting",
        Task::Surface => "surface",
        Task::Runtime => "runtime",
    }
}

/// State of an entry in the models folder.
struct State {
    /// Size of the file, if it is installed.
    bytes: Option<u64>,
    sum: &'static str,
}

impl State {
    fn of(entry: &ModelEntry, models: &Path) -> Result<State> {
        let path = entry.path(models);
        let Some(metadata) = path.metadata().ok().filter(std::fs::Metadata::is_file) else {
            return Ok(State { bytes: None, sum: "-" });
        };
        let sum = match &entry.sha256 {
            None => "none known",
            Some(wanted) if *wanted == sum::of_file(&path)? => "right",
            Some(_) => "WRONG",
        };
        Ok(State { bytes: Some(metadata.len()), sum })
    }
}
