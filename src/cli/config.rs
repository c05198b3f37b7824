//! Configuration. A flag overrides the environment, the environment overrides the file, the file overrides
//! the default. The file is TOML whose keys are the names of the flags; a table such as `[serve]` is for that
//! command only. `viola config` shows each value and its source, and checks them.

use super::args::wrong_arguments;
use super::serve::ServeArguments;
use super::work::WorkArguments;
use anyhow::{Context, Result, bail};
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Arg, ArgAction, Args, Command, FromArgMatches};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use viola_storage::check_database_url;

const FLAG: &str = "--config";
const VARIABLE: &str = "VIOLA_CONFIG";

/// Commands that take a configuration.
const CONFIGURED: [&str; 7] = ["serve", "work", "migrate", "keys", "jobs", "tenants", "clean"];

/// A line for the help of each of them.
pub const HELP: &str = "Settings: a flag, else the environment, else the file named by --config FILE or VIOLA_CONFIG. \
    `viola config COMMAND` shows all of them.";

#[derive(Args)]
pub struct ConfigArguments {
    /// Command whose configuration is shown.
    #[arg(value_name = "COMMAND", default_value = "serve")]
    command: String,
    /// Configuration file.
    #[arg(long = "config", value_name = "FILE", env = VARIABLE, value_parser = OsStringValueParser::new().map(PathBuf::from))]
    file: Option<PathBuf>,
}

/// A configuration file's settings for one command, by the names of flags.
type Settings = BTreeMap<String, toml::Value>;

/// Returns the process's arguments with the settings of the configuration file and without its name. Those of a command
/// without a configuration are returned unchanged, so that clap refuses `--config`.
pub fn with_file(given: impl Iterator<Item = OsString>, program: &Command) -> Result<Vec<OsString>> {
    let given: Vec<OsString> = given.collect();
    let (mut arguments, file) = take_file(given.clone());
    // Flags such as -q may stand before the command.
    let is_word = |argument: &OsString| !argument.to_string_lossy().starts_with('-');
    let Some(first) = arguments.iter().skip(1).position(is_word).map(|position| position + 1) else {
        return Ok(given);
    };
    let Some(name) = arguments[first].to_str().map(str::to_owned) else { return Ok(given) };
    let is_configured = CONFIGURED.contains(&name.as_str());
    if !is_configured && name != "config" {
        return Ok(given);
    }
    if arguments.iter().any(|argument| argument == FLAG) {
        return Err(wrong_arguments(format!("{FLAG} needs the path of a file")));
    }
    let Some(file) = file else { return Ok(arguments) };
    if !is_configured {
        arguments.extend([FLAG.into(), file.into()]);
        return Ok(arguments);
    }
    let mut command = program.find_subcommand(&name);
    let mut at = first + 1;
    // `viola keys create`: the flags belong to the inner command. Flags such as -q may stand before it.
    while let Some(next) = arguments.iter().skip(at).position(is_word)
        && let Some(inner) = arguments[at + next].to_str()
        && let Some(found) = command.and_then(|command| command.find_subcommand(inner))
    {
        command = Some(found);
        at += next + 1;
    }
    let Some(command) = command else { return Ok(arguments) };
    let settings = read(&file, &name, program)?;
    let added = added(&settings, command, &arguments[at..]).map_err(wrong_file)?;
    arguments.splice(at..at, added);
    Ok(arguments)
}

/// Takes `--config` out of the arguments and returns its file, by default that of the variable. A `--config` without a
/// file stays.
fn take_file(mut arguments: Vec<OsString>) -> (Vec<OsString>, Option<PathBuf>) {
    // A shell may unset a variable by making it empty.
    let mut file = std::env::var_os(VARIABLE).filter(|file| !file.is_empty()).map(PathBuf::from);
    let mut at = 1;
    while at < arguments.len() {
        let text = arguments[at].to_string_lossy().into_owned();
        if text == FLAG && at + 1 < arguments.len() {
            file = Some(arguments.remove(at + 1).into());
            arguments.remove(at);
        } else if let Some(path) = text.strip_prefix("--config=") {
            file = Some(path.into());
            arguments.remove(at);
        } else {
            at += 1;
        }
    }
    (arguments, file)
}

/// Returns the error of a configuration file as that of wrong arguments: its values are arguments.
fn wrong_file(error: anyhow::Error) -> anyhow::Error {
    wrong_arguments(format!("{error:#}"))
}

/// Returns the settings of a file for a command.
fn read(file: &Path, command: &str, program: &Command) -> Result<Settings> {
    settings_in(file, command, program).map_err(wrong_file)
}

fn settings_in(file: &Path, command: &str, program: &Command) -> Result<Settings> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let all: Settings = toml::from_str(&text).with_context(|| file.display().to_string())?;
    let mut settings = Settings::new();
    let mut own = Settings::new();
    for (key, value) in all {
        match value {
            toml::Value::Table(table) if CONFIGURED.contains(&key.as_str()) => {
                let known = |name: &String| is_known(name, program.find_subcommand(&key).as_slice());
                if let Some(unknown) = table.keys().find(|name| !known(name)) {
                    bail!("{}: `{key}` has no setting called `{unknown}`", file.display());
                }
                if key == command {
                    own.extend(table);
                }
            }
            value => {
                let commands: Vec<&Command> =
                    CONFIGURED.iter().filter_map(|name| program.find_subcommand(name)).collect();
                if !is_known(&key, &commands) {
                    bail!("{}: no setting is called `{key}`; `viola config` lists them", file.display());
                }
                settings.insert(key, value);
            }
        }
    }
    settings.extend(own);
    Ok(settings)
}

fn is_known(name: &str, commands: &[&Command]) -> bool {
    commands.iter().any(|command| {
        let inner: Vec<&Command> = command.get_subcommands().collect();
        flag(command, name).is_some() || is_known(name, &inner)
    })
}

fn flag<'a>(command: &'a Command, name: &str) -> Option<&'a Arg> {
    command.get_arguments().find(|arg| arg.get_long() == Some(name))
}

/// Returns the file's settings as flags, without those that the arguments or the environment set.
fn added(settings: &Settings, command: &Command, given: &[OsString]) -> Result<Vec<OsString>> {
    let mut added = Vec::new();
    for (name, value) in settings {
        let Some(arg) = flag(command, name) else { continue };
        let long = format!("--{name}");
        let is_given = given.iter().any(|given| {
            let given = given.to_string_lossy();
            given == long.as_str() || given.strip_prefix(&long).is_some_and(|rest| rest.starts_with('='))
        });
        if is_given || arg.get_env().is_some_and(|variable| std::env::var_os(variable).is_some()) {
            continue;
        }
        let is_switch = matches!(arg.get_action(), ArgAction::SetTrue);
        match value {
            toml::Value::Boolean(true) if is_switch => added.push(long.into()),
            toml::Value::Boolean(false) if is_switch => {}
            toml::Value::String(text) if !is_switch => added.push(format!("{long}={text}").into()),
            toml::Value::Integer(_) | toml::Value::Float(_) if !is_switch => {
                added.push(format!("{long}={value}").into());
            }
            _ if is_switch => bail!("the setting `{name}` is true or false"),
            _ => bail!("the setting `{name}` is a text or a number"),
        }
    }
    Ok(added)
}

/// Prints the configuration of a command, without secrets, and refuses it if the command would.
pub fn run(arguments: &ConfigArguments, program: &Command) -> Result<()> {
    let name = arguments.command.as_str();
    let command = program.find_subcommand(name).filter(|_| CONFIGURED.contains(&name));
    let Some(command) = command else {
        let text = format!("`{name}` has no configuration; the commands with one: {}", CONFIGURED.join(", "));
        return Err(wrong_arguments(text));
    };
    // A shell may unset a variable by making it empty.
    let file = arguments.file.as_deref().filter(|file| !file.as_os_str().is_empty());
    let settings = file.map(|file| read(file, name, program)).transpose()?.unwrap_or_default();
    // The settings of `keys` and `tenants` are those of what they do.
    let (mut shown_names, mut database_url) = (BTreeSet::new(), None);
    let arguments = command.get_subcommands().chain([command]).flat_map(Command::get_arguments);
    for arg in arguments.filter(|arg| !arg.is_hide_set() && !arg.is_positional()) {
        let Some(long) = arg.get_long().filter(|long| *long != "help") else { continue };
        if !shown_names.insert(long) {
            continue;
        }
        let (value, source) = value_of(arg, settings.get(long));
        if long == "database-url" {
            database_url.clone_from(&value);
        }
        let shown = match value {
            Some(_) if arg.is_hide_env_values_set() => "(set, and secret)".to_owned(),
            Some(value) => value,
            None => "(not set)".to_owned(),
        };
        let variable = arg.get_env().map_or(String::new(), |name| format!(" [{}]", name.to_string_lossy()));
        println!("{long} = {shown}    # {source}{variable}");
    }
    if let Some(Err(error)) = database_url.as_deref().map(check_database_url) {
        return Err(wrong_arguments(error));
    }
    check(command, file, program)
}

/// Refuses values that the command itself refuses at its start.
fn check(command: &Command, file: Option<&Path>, program: &Command) -> Result<()> {
    // `viola keys` has its settings in the commands below it, which have further arguments.
    if command.has_subcommands() {
        return Ok(());
    }
    let file = file.map(|file| [OsString::from(FLAG), file.into()]);
    let given = ["viola", command.get_name()].map(OsString::from).into_iter();
    let arguments = with_file(given.chain(file.into_iter().flatten()), program)?;
    let matches = program.clone().try_get_matches_from(arguments)?;
    // Values that exclude each other.
    match matches.subcommand() {
        Some(("serve", matches)) => ServeArguments::from_arg_matches(matches)?.check(),
        Some(("work", matches)) => WorkArguments::from_arg_matches(matches)?.check(),
        _ => Ok(()),
    }
}

fn value_of(arg: &Arg, setting: Option<&toml::Value>) -> (Option<String>, &'static str) {
    if let Some(value) = arg.get_env().and_then(std::env::var_os) {
        return (Some(value.to_string_lossy().into_owned()), "environment");
    }
    if let Some(value) = setting {
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        return (Some(text), "file");
    }
    let default = arg.get_default_values().first().map(|value| value.to_string_lossy().into_owned());
    (default, "default")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn program() -> Command {
        crate::cli::Arguments::command()
    }

    /// Returns the arguments after the program's name with the settings of a file.
    fn expanded(file: &str, given: &str) -> Result<String, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("viola.toml");
        std::fs::write(&path, file).unwrap();
        let config = format!("--config={}", path.display());
        let given = format!("viola {given}");
        let given = given.split(' ').map(OsString::from).chain([config.into()]);
        let arguments = with_file(given, &program()).map_err(|error| format!("{error:#}"))?;
        let words: Vec<String> =
            arguments.into_iter().skip(1).map(|word| word.into_string().unwrap()).collect();
        Ok(words.join(" ").replace(path.to_str().unwrap(), "FILE"))
    }

    #[test]
    fn a_file_stands_behind_flags_and_before_defaults() {
        let file = "listen = \"127.0.0.1:1\"\nworkers = 2\nno-worker = true\n[work]\nworkers = 3\n";
        for (file, given, expected) in [
            (file, "serve", "serve --listen=127.0.0.1:1 --no-worker --workers=2"),
            (file, "serve --workers 5", "serve --listen=127.0.0.1:1 --no-worker --workers 5"),
            (file, "serve --workers=5", "serve --listen=127.0.0.1:1 --no-worker --workers=5"),
            (file, "work", "work --workers=3"),
            (file, "keys list", "keys list"),
            // clap refuses the flag of a command without a configuration.
            (file, "openapi", "openapi --config=FILE"),
            (file, "config work", "config work --config FILE"),
            ("data = \"d\"", "keys -q list --json", "keys -q list --data=d --json"),
        ] {
            assert_eq!(expanded(file, given).as_deref(), Ok(expected), "{given}");
        }
        let without_file = ["viola", "serve", "--config"].map(OsString::from);
        let error = with_file(without_file.into_iter(), &program()).unwrap_err();
        assert!(error.is::<clap::Error>() && error.to_string().contains("needs the path"), "{error}");
    }

    #[test]
    fn what_is_wrong_in_a_file_is_named() {
        let cases = [
            ("lisen = \"x\"", "`lisen`"),
            ("[serve]\nlisen = 1", "`lisen`"),
            ("[work]\nno-worker = true", "`no-worker`"),
            ("no-worker = 1", "`no-worker`"),
            ("workers = [1]", "`workers`"),
            ("workers = ", "viola.toml"),
        ];
        for (file, named) in cases {
            let error = expanded(file, "serve").unwrap_err();
            assert!(error.contains(named), "{file}: {error}");
        }
    }
}
