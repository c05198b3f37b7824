//! The sources of all crates.

use std::fs;
use std::path::{Path, PathBuf};

/// One source file.
pub struct Source {
    /// The crate's name; `viola` is the service.
    pub krate: String,
    /// Path of its module from the crate's root: `api::uploads` is `["api", "uploads"]`.
    pub module: Vec<String>,
    pub path: PathBuf,
    pub text: String,
}

impl Source {
    /// Returns whether it belongs to the service's own crate, apart from its root files.
    pub fn is_of_service(&self) -> bool {
        self.krate == "viola" && !self.module.is_empty()
    }

    pub fn first_module(&self) -> &str {
        self.module.first().map_or("", String::as_str)
    }

    /// Returns lines with their numbers, without comments and without the tests at the file's end.
    pub fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let code = self.text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        let lines = code.lines().enumerate().map(|(index, line)| (index + 1, line));
        lines.filter(|(_, line)| !line.trim_start().starts_with("//"))
    }
}

/// Returns all sources of the workspace, in the order of their paths.
pub fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut all = Vec::new();
    collect("viola", &root.join("src"), &mut all);
    for folder in fs::read_dir(root.join("crates")).unwrap() {
        let folder = folder.unwrap();
        let name = folder.file_name().into_string().unwrap();
        collect(&name, &folder.path().join("src"), &mut all);
    }
    all.sort_by(|a, b| a.path.cmp(&b.path));
    all
}

/// Returns the sources of the integration tests.
pub fn tests() -> Vec<Source> {
    let mut all = Vec::new();
    collect("tests", &Path::new(env!("CARGO_MANIFEST_DIR")).join("tests"), &mut all);
    all
}

fn collect(krate: &str, source_root: &Path, into: &mut Vec<Source>) {
    let mut folders = vec![source_root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let inside = path.strip_prefix(source_root).unwrap().with_extension("");
                let parts = inside.iter().map(|part| part.to_string_lossy().into_owned());
                let module = parts.filter(|part| !["lib", "main", "mod"].contains(&part.as_str())).collect();
                let text = fs::read_to_string(&path).unwrap();
                into.push(Source { krate: krate.to_owned(), module, path, text });
            }
        }
    }
}
