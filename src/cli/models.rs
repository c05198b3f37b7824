//! `viola models`: lists, fetches and checks the neural networks.

mod check;
mod download;
mod drawing;
mod fetch;
#[cfg(test)]
mod test_server;

use super::args::NO_NETWORKS;
use super::{output, sum};
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use serde_json::json;
use std::path::{Path, PathBuf};
use viola_network::Weights;
use viola_network::manifest::{Manifest, ModelEntry, Source, Task};

const DEFAULT_FOLDER: &str = "viola-models";

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
        /// Print a list of objects instead of the table.
        #[arg(long)]
        json: bool,
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
    #[arg(long, env = "VIOLA_MODELS", default_value = DEFAULT_FOLDER, value_name = "DIR", value_parser = folder)]
    models: PathBuf,
}

/// Refuses the value that is no folder for the other commands.
fn folder(text: &str) -> Result<PathBuf, String> {
    match text {
        NO_NETWORKS => Err(format!("`{NO_NETWORKS}` switches networks off; name a folder with --models DIR")),
        // A shell may unset a variable by making it empty.
        "" => Ok(PathBuf::from(DEFAULT_FOLDER)),
        text => Ok(PathBuf::from(text)),
    }
}

impl Folder {
    fn manifest(&self) -> Result<Manifest> {
        Manifest::with_folder(&self.models)
            .with_context(|| format!("models folder {}", self.models.display()))
    }
}

pub fn run(arguments: &ModelsArguments) -> Result<()> {
    match &arguments.command {
        Command::List { folder, json } => list(folder, *json),
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

fn list(folder: &Folder, as_json: bool) -> Result<()> {
    let manifest = folder.manifest()?;
    let with_state = |entry| -> Result<_> { Ok((entry, State::of(entry, &folder.models)?)) };
    let networks = manifest.networks.iter().map(with_state).collect::<Result<Vec<_>>>()?;
    let document = |(entry, state): &(&ModelEntry, State)| {
        let State { bytes, installed, sum } = state;
        let (name, task, licence) = (&entry.name, task(entry.task), &entry.licence);
        json!({"name": name, "task": task, "bytes": bytes, "installed": installed, "sum": sum, "licence": licence})
    };
    let head = ["name", "task", "size", "installed", "sum", "licence"];
    output::print_list(&networks, as_json, document, head, |(entry, state)| {
        [
            entry.name.clone(),
            task(entry.task).to_owned(),
            state.bytes.map_or("-".to_owned(), |bytes| format!("{:.1} MB", bytes as f64 / 1e6)),
            state.installed.to_owned(),
            state.sum.to_owned(),
            entry.licence.clone(),
        ]
    })?;
    for entry in manifest.networks.iter().filter(|_| !as_json) {
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
    /// Size of the weights, if they are installed.
    bytes: Option<u64>,
    installed: &'static str,
    sum: &'static str,
}

impl State {
    fn of(entry: &ModelEntry, models: &Path) -> Result<State> {
        let Some(weights) = entry.weights(Some(models)) else {
            return Ok(State { bytes: None, installed: "no", sum: "-" });
        };
        let (bytes, installed) = match &weights {
            Weights::File(path) => {
                let size = path.metadata().with_context(|| format!("cannot read {}", path.display()))?.len();
                (size, "yes")
            }
            Weights::BuiltIn { bytes, .. } => (bytes.len() as u64, "built in"),
        };
        let sum = sum::of_weights(&weights)?;
        let sum = match &entry.sha256 {
            None => "none known",
            Some(wanted) if *wanted == sum => "right",
            // The owner of the folder replaced the built-in weights.
            Some(_) if entry.source.is_built_in() => "own file",
            Some(_) => "WRONG",
        };
        Ok(State { bytes: Some(bytes), installed, sum })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maximum size of all weights in the program.
    const MAX_BUILT_IN_BYTES: usize = 4 << 20;

    #[test]
    fn built_in_weights_are_those_of_the_manifest_and_small() {
        let manifest = Manifest::built_in().unwrap();
        let mut size = 0;
        for entry in manifest.networks.iter().filter(|entry| entry.source.is_built_in()) {
            let Some(Weights::BuiltIn { bytes, .. }) = entry.weights(None) else { panic!("{}", entry.name) };
            let sum = sum::of_bytes(bytes);
            assert_eq!(Some(&sum), entry.sha256.as_ref(), "{}: models.toml has another sum", entry.name);
            size += bytes.len();
        }
        assert!(0 < size && size <= MAX_BUILT_IN_BYTES, "{size} bytes");
    }

    #[test]
    fn the_list_tells_built_in_weights_from_own_ones() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = Manifest::built_in().unwrap();
        let columns = manifest.find("columns").unwrap();
        let state = State::of(columns, folder.path()).unwrap();
        assert_eq!((state.installed, state.sum), ("built in", "right"));

        let path = columns.path(folder.path());
        std::fs::create_dir(path.parent().unwrap()).unwrap();
        std::fs::write(&path, b"trained at home").unwrap();
        let state = State::of(columns, folder.path()).unwrap();
        assert_eq!((state.installed, state.sum, state.bytes), ("yes", "own file", Some(15)));

        let fastdepth = manifest.find("fastdepth").unwrap();
        let state = State::of(fastdepth, folder.path()).unwrap();
        assert_eq!((state.installed, state.bytes), ("no", None));
    }

    #[test]
    fn the_word_that_switches_networks_off_is_no_folder() {
        assert!(folder("none").is_err());
        assert_eq!(folder("./none"), Ok(PathBuf::from("./none")));
        assert_eq!(folder(""), Ok(PathBuf::from(DEFAULT_FOLDER)));
    }
}
