//! The invariants of the house, held over the sources: who may import whom.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Each module and its floor. A module imports only from floors below it, and freely within itself.
const FLOORS: &[(&str, u8)] = &[
    ("geometry", 1),
    ("progress", 1),
    ("container", 1),
    ("taxonomy", 1),
    ("video", 2),
    ("clip", 3),
    ("lidar", 3),
    ("network", 3),
    ("align", 4),
    ("home", 5),
    ("simulate", 5),
    ("stopwatch", 6),
    ("evaluate", 7),
    ("storage", 7),
    ("jobs", 8),
    ("webhooks", 8),
    ("api", 9),
    ("cli", 10),
];

/// Crates that only some modules may know.
const OWNED: &[(&str, &[&str])] = &[
    ("axum", &["api"]),
    ("tower", &["api"]),
    ("tower_http", &["api"]),
    ("utoipa_axum", &["api"]),
    ("sqlx", &["storage"]),
    ("object_store", &["storage"]),
    ("rten", &["network"]),
    ("ort", &["network"]),
    ("libloading", &["network"]),
    ("mp4_atom", &["video"]),
    ("rust_h264", &["video"]),
    ("rust_h265", &["video"]),
    ("clap", &["cli"]),
    ("reqwest", &["cli", "webhooks"]),
];

/// What the floors of the method (up to `home` and `simulate`) must not know.
const IMPURE: &[&str] = &[
    "tokio",
    "async fn",
    ".await",
    "SystemTime",
    "Instant",
    "std::env",
    "jiff",
    "tracing::",
    "rand::rng(",
    "from_os_rng",
    "thread_rng",
];

struct Source {
    module: String,
    path: PathBuf,
    /// Code lines with their numbers, comments and the tests at the end of the file left out.
    lines: Vec<(usize, String)>,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    collect(&root, &mut paths);
    paths.sort();
    paths
        .into_iter()
        .map(|path| {
            let inside = path.strip_prefix(&root).unwrap();
            let first = inside.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
            let module = first.trim_end_matches(".rs").to_owned();
            let text = fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
            let lines = code
                .lines()
                .enumerate()
                .filter(|(_, line)| !line.trim_start().starts_with("//"))
                .map(|(i, line)| (i + 1, line.to_owned()))
                .collect();
            Source { module, path, lines }
        })
        .collect()
}

fn collect(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// The words that follow `marker` in a line: `crate::align` gives `align`.
fn names_after<'a>(line: &'a str, marker: &'a str) -> impl Iterator<Item = String> + 'a {
    line.match_indices(marker).flat_map(move |(at, _)| {
        let rest = &line[at + marker.len()..];
        let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        match rest.strip_prefix('{') {
            Some(group) => group.split(',').map(|part| word(part.trim())).collect::<Vec<_>>(),
            None => vec![word(rest)],
        }
    })
}

fn check(broken: Vec<String>) {
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

#[test]
fn floors_import_downwards() {
    let floors: BTreeMap<&str, u8> = FLOORS.iter().copied().collect();
    let mut broken = Vec::new();
    for source in sources().iter().filter(|s| s.module != "main" && s.module != "lib") {
        let Some(&own) = floors.get(source.module.as_str()) else {
            broken.push(format!(
                "{}: module '{}' has no floor in tests/house.rs",
                source.path.display(),
                source.module
            ));
            continue;
        };
        for (number, line) in &source.lines {
            for name in names_after(line, "crate::").filter(|name| *name != source.module) {
                if let Some(&other) = floors.get(name.as_str())
                    && other >= own
                {
                    broken.push(format!(
                        "{}:{number}: {} imports {name}",
                        source.path.display(),
                        source.module
                    ));
                }
            }
        }
    }
    check(broken);
}

#[test]
fn each_foreign_world_has_one_door() {
    let mut broken = Vec::new();
    for source in sources() {
        for (number, line) in &source.lines {
            for (name, owners) in OWNED.iter().filter(|(_, owners)| !owners.contains(&source.module.as_str()))
            {
                let word = format!("{name}::");
                let used = line.match_indices(&word).any(|(at, _)| {
                    !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':')
                });
                if used {
                    broken
                        .push(format!("{}:{number}: only {owners:?} may know {name}", source.path.display()));
                }
            }
        }
    }
    check(broken);
}

#[test]
fn the_method_is_pure() {
    let floors: BTreeMap<&str, u8> = FLOORS.iter().copied().collect();
    let mut broken = Vec::new();
    for source in sources() {
        if floors.get(source.module.as_str()).is_none_or(|floor| *floor > 4) {
            continue;
        }
        for (number, line) in &source.lines {
            for word in IMPURE.iter().filter(|word| line.contains(**word)) {
                broken.push(format!("{}:{number}: the method must not know '{word}'", source.path.display()));
            }
        }
    }
    check(broken);
}

#[test]
fn files_stay_small() {
    let long = sources()
        .iter()
        .filter_map(|s| {
            let lines = fs::read_to_string(&s.path).unwrap().lines().count();
            (lines > 400).then(|| format!("{} has {lines} lines; split it by what it does", s.path.display()))
        })
        .collect();
    check(long);
}
