//! The invariants of the sources and of the pages: allowed imports, lengths of files and functions, links, sentences.

mod circles;
mod features;
mod image;
mod knobs;
mod pages;
mod reasons;
mod sources;
mod suites;

use sources::{Source, sources};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Each crate below `crates/` with its floor. A crate depends on crates of lower floors only.
const CRATES: &[(&str, u8)] = &[
    ("viola-geometry", 1),
    ("viola-formats", 2),
    ("viola-network", 2),
    ("viola-reconstruct", 3),
    ("viola-align", 4),
    ("viola-home", 5),
    ("viola-lab", 6),
    ("viola-storage", 7),
];

/// Crates that may know async, clocks and the environment.
const WORLDLY: &[&str] = &["viola", "viola-lab", "viola-storage"];

/// Each module of the service with its floor.
const MODULES: &[(&str, u8)] = &[("jobs", 1), ("webhooks", 1), ("api", 2), ("cli", 3)];

/// Dependencies that only some modules of the service may use.
const OWNED: &[(&str, &[&str])] = &[
    ("axum", &["api"]),
    ("tower", &["api"]),
    ("tower_http", &["api"]),
    ("utoipa", &["api"]),
    ("utoipa_axum", &["api"]),
    ("clap", &["cli"]),
    ("reqwest", &["cli", "webhooks"]),
];

/// Dependencies that only one crate may have.
const HELD: &[(&str, &str)] = &[
    ("rten", "viola-network"),
    ("ort", "viola-network"),
    ("libloading", "viola-network"),
    ("mp4-atom", "viola-formats"),
    ("rust_h264", "viola-formats"),
    ("rust_h265", "viola-formats"),
    ("sqlx", "viola-storage"),
    ("object_store", "viola-storage"),
];

/// Words that the method's crates must not contain.
const IMPURE: &[&str] = &[
    "tokio",
    "async fn",
    ".await",
    "SystemTime",
    "Instant::now",
    "std::env",
    "jiff",
    "tracing::",
    "rand::rng(",
    "from_os_rng",
    "thread_rng",
];

const MOST_LINES_OF_A_FILE: usize = 400;
const MOST_LINES_OF_A_FUNCTION: usize = 80;
/// Two files may import each other; three may not form a circle.
const MOST_FILES_OF_A_CIRCLE: usize = 2;

fn check(broken: Vec<String>) {
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the dependencies of the crate in a folder, without those of its tests.
fn dependencies(folder: &Path) -> Vec<String> {
    let path = folder.join("Cargo.toml");
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let document: toml::Table = text.parse().unwrap();
    document["dependencies"].as_table().unwrap().keys().cloned().collect()
}

#[test]
fn crates_depend_downwards() {
    let floors: BTreeMap<&str, u8> = CRATES.iter().copied().collect();
    let mut broken = Vec::new();
    let crates = CRATES.iter().map(|(name, floor)| (*name, *floor, root().join("crates").join(name)));
    for (name, floor, folder) in crates.chain([("viola", u8::MAX, root().to_owned())]) {
        for other in dependencies(&folder) {
            if floors.get(other.as_str()).is_some_and(|other| *other >= floor) {
                broken.push(format!("{name} depends on {other}, which is not below it"));
            }
            for (held, owner) in HELD.iter().filter(|(held, _)| *held == other) {
                if *owner != name {
                    broken.push(format!("{name} depends on {held}, which only {owner} may know"));
                }
            }
        }
    }
    let folders = fs::read_dir(root().join("crates")).unwrap();
    for folder in folders {
        let name = folder.unwrap().file_name().into_string().unwrap();
        if !floors.contains_key(name.as_str()) {
            broken.push(format!("crate {name} has no floor in tests/house/main.rs"));
        }
    }
    check(broken);
}

#[test]
fn modules_of_the_service_import_downwards() {
    let floors: BTreeMap<&str, u8> = MODULES.iter().copied().collect();
    let mut broken = Vec::new();
    for source in sources().iter().filter(|source| source.is_of_service()) {
        let Some(&own) = floors.get(source.first_module()) else {
            broken.push(format!("{} has no floor in tests/house/main.rs", source.path.display()));
            continue;
        };
        for (number, line) in source.code() {
            if line.contains("use crate::{") {
                let place = source.path.display();
                broken.push(format!("{place}:{number}: import each module of the crate by itself"));
            }
            for (module, _) in MODULES.iter().filter(|(_, floor)| *floor >= own) {
                let is_imported = names_path(line, &format!("crate::{module}"));
                if *module != source.first_module() && is_imported {
                    broken.push(format!("{}:{number} imports {module}", source.path.display()));
                }
            }
        }
    }
    check(broken);
}

#[test]
fn each_foreign_world_has_one_door() {
    let mut broken = Vec::new();
    for source in sources().iter().filter(|source| source.is_of_service()) {
        for (number, line) in source.code() {
            for (name, owners) in OWNED.iter().filter(|(_, owners)| !owners.contains(&source.first_module()))
            {
                if names_path(line, &format!("{name}::")) {
                    broken
                        .push(format!("{}:{number}: only {owners:?} may know {name}", source.path.display()));
                }
            }
        }
    }
    check(broken);
}

/// Returns whether a line contains `path` as the start of a path.
fn names_path(line: &str, path: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(path).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + path.len()..].chars().next();
        let ends = path.ends_with(':') || !after.is_some_and(is_word);
        ends && !before.is_some_and(|c| is_word(c) || c == ':')
    })
}

/// Modules that may start other processes: video decoders, jobs, and the command line, which fetches
/// and unpacks networks by other programs.
const START_PROCESSES: &[&str] = &["video", "jobs", "cli"];

/// Returns whether a line names the type that starts processes, or calls it by a name that was imported in a group.
fn starts_a_process(line: &str) -> bool {
    let paths = ["process::Command", "std::process::Command", "tokio::process::Command", "Command::new"];
    paths.iter().any(|path| names_path(line, path))
}

#[test]
fn few_start_processes() {
    let may_start = |source: &&Source| START_PROCESSES.contains(&source.first_module());
    let mut broken = Vec::new();
    for source in sources().iter().filter(|source| !may_start(source)) {
        for (number, line) in source.code().filter(|(_, line)| starts_a_process(line)) {
            broken.push(format!("{}:{number}: it starts a process: {line}", source.path.display()));
        }
    }
    check(broken);
}

#[test]
fn the_method_is_pure() {
    let mut broken = Vec::new();
    for source in sources().iter().filter(|source| !WORLDLY.contains(&source.krate.as_str())) {
        for (number, line) in source.code() {
            for word in IMPURE.iter().filter(|word| line.contains(**word)) {
                broken.push(format!("{}:{number}: the method must not know '{word}'", source.path.display()));
            }
        }
    }
    check(broken);
}

/// Calls that block a thread until async work is done. In tokio's pool of blocking threads they deadlock:
/// async work, such as reading a local blob, needs a thread of the same pool.
const BLOCKING_WAITS: &[&str] = &[
    "block_on(",
    "blocking_send(",
    "blocking_recv(",
    "blocking_lock(",
    "blocking_read(",
    "blocking_write(",
    "block_in_place(",
    "SyncIoBridge",
    "reqwest::blocking",
];

#[test]
fn no_thread_waits_for_async_work() {
    // A command of the command line waits on its own thread; tests have runtimes of their own.
    let may_wait = |source: &Source| {
        source.first_module() == "cli" || source.path.to_string_lossy().contains("conformance")
    };
    let mut broken = Vec::new();
    for source in sources().iter().filter(|source| !may_wait(source)) {
        for (number, line) in source.code() {
            for wait in BLOCKING_WAITS.iter().filter(|wait| line.contains(**wait)) {
                broken.push(format!("{}:{number}: {wait} waits for async work", source.path.display()));
            }
        }
    }
    check(broken);
}

/// Lines that read the clock of this machine, by file; an empty text stands for all lines.
const OWN_CLOCK: &[(&str, &str)] = &[
    ("crates/viola-storage/src/database/clock.rs", ""),
    ("src/api/clips.rs", "Timestamp::now() + AHEAD"),
    ("src/webhooks/send.rs", "Timestamp::now().as_second()"),
];

/// The clock of one machine may be wrong, and processes compare the times that rows keep.
#[test]
fn times_come_from_the_storage() {
    let is_test = |part: &String| part == "tests" || part == "conformance";
    let mut broken = Vec::new();
    let has_clock = |source: &&Source| source.is_of_service() || source.krate == "viola-storage";
    for source in sources().iter().filter(has_clock) {
        if source.module.iter().any(is_test) {
            continue;
        }
        for (number, line) in source.code().filter(|(_, line)| line.contains("Timestamp::now")) {
            let may = OWN_CLOCK.iter().any(|(file, text)| source.path.ends_with(file) && line.contains(text));
            if !may {
                broken.push(format!("{}:{number}: take the time of Storage::now", source.path.display()));
            }
        }
    }
    check(broken);
}

#[test]
fn files_stay_small() {
    let long = |source: &Source| {
        let lines = source.text.lines().count();
        let place = source.path.display();
        (lines > MOST_LINES_OF_A_FILE).then(|| format!("{place} has {lines} lines; split it by what it does"))
    };
    check(sources().iter().filter_map(long).collect());
}

#[test]
fn functions_stay_short() {
    let mut broken = Vec::new();
    for source in sources() {
        let lines: Vec<&str> = source.text.lines().collect();
        for (at, line) in lines.iter().enumerate().filter(|(_, line)| is_function(line)) {
            // rustfmt puts a function's last brace under its first letter.
            let indent = &line[..line.len() - line.trim_start().len()];
            let end = lines[at..].iter().position(|end| *end == format!("{indent}}}")).unwrap_or(0);
            if end + 1 > MOST_LINES_OF_A_FUNCTION {
                broken.push(format!("{}:{}: a function of {} lines", source.path.display(), at + 1, end + 1));
            }
        }
    }
    check(broken);
}

fn is_function(line: &str) -> bool {
    let head = line.trim_start();
    let head = match head.strip_prefix("pub(") {
        Some(within) => within.split_once(") ").map_or("", |(_, rest)| rest),
        None => head.strip_prefix("pub ").unwrap_or(head),
    };
    let words = ["async ", "const ", "unsafe "];
    let rest = words.iter().fold(head, |head, word| head.strip_prefix(word).unwrap_or(head));
    rest.starts_with("fn ") && !line.trim_end().ends_with([';', '}'])
}

#[test]
fn functions_and_starts_of_processes_are_found() {
    for (line, is_expected) in [
        ("fn a() {", true),
        ("    pub(in crate::api) async fn a(", true),
        ("pub(super) const fn a() -> usize {", true),
        ("fn a() {}", false),
        ("    fn a();", false),
        ("pub(super) struct A(usize);", false),
    ] {
        assert_eq!(is_function(line), is_expected, "{line}");
    }
    for (line, is_expected) in [
        ("use std::process::Command;", true),
        ("    let child = Command::new(program).spawn();", true),
        ("use std::process::{ExitCode, Stdio};", false),
        ("let command = clap::Command::new(name);", false),
    ] {
        assert_eq!(starts_a_process(line), is_expected, "{line}");
    }
}

#[test]
fn no_three_files_import_each_other_in_a_circle() {
    let all = sources();
    let mut broken = Vec::new();
    for krate in CRATES.iter().map(|(name, _)| *name).chain(["viola"]) {
        let own: Vec<&Source> = all.iter().filter(|source| source.krate == krate).collect();
        let circles = circles::circles(&own);
        for circle in circles.iter().filter(|circle| circle.len() > MOST_FILES_OF_A_CIRCLE) {
            broken.push(format!("{krate}: {}", circle.join(" -> ")));
        }
    }
    check(broken);
}

#[test]
fn unset_fields_of_params_are_constants() {
    check(knobs::unset(&sources(), &sources::tests()));
}
