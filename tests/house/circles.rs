//! Files of a crate that import each other in a circle.
//!
//! An edge runs from a file to each file that defines a name which its `use` declarations import. A re-export
//! (`pub use`) is followed to the definition, and adds no edge itself.

use crate::sources::Source;
use std::collections::{BTreeMap, BTreeSet};

type Path = Vec<String>;

/// One parsed `use` declaration of a file.
struct Import {
    path: Path,
    /// The name under which other files import it from here.
    name: String,
    is_public: bool,
}

/// Returns every circle, as the modules in it.
pub fn circles(sources: &[&Source]) -> Vec<Vec<String>> {
    let imports: BTreeMap<Path, Vec<Import>> =
        sources.iter().map(|source| (source.module.clone(), imports(source))).collect();
    let mut arrows: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
    for (module, own) in &imports {
        for import in own.iter().filter(|import| !import.is_public) {
            if let Some(target) = resolve(&imports, module, &import.path, 0)
                && target != module
            {
                arrows.entry(module).or_default().insert(target);
            }
        }
    }
    let reach = |from: &Path| reachable(&arrows, from);
    let reached: BTreeMap<&Path, BTreeSet<&Path>> =
        imports.keys().map(|module| (module, reach(module))).collect();
    let mut found: BTreeSet<Vec<String>> = BTreeSet::new();
    for (module, others) in &reached {
        let circle: Vec<String> = others
            .iter()
            .filter(|other| reached[*other].contains(*module))
            .map(|other| if other.is_empty() { "lib".to_owned() } else { other.join("::") })
            .collect();
        if circle.len() > 1 {
            found.insert(circle);
        }
    }
    found.into_iter().collect()
}

fn reachable<'a>(arrows: &BTreeMap<&'a Path, BTreeSet<&'a Path>>, from: &Path) -> BTreeSet<&'a Path> {
    let mut seen = BTreeSet::new();
    let mut open: Vec<&'a Path> = arrows.get(from).into_iter().flatten().copied().collect();
    while let Some(next) = open.pop() {
        if seen.insert(next) {
            open.extend(arrows.get(next).into_iter().flatten());
        }
    }
    seen
}

/// Returns the module that defines the target of a path; `None` for other crates.
fn resolve<'a>(
    imports: &'a BTreeMap<Path, Vec<Import>>,
    module: &[String],
    path: &[String],
    depth: usize,
) -> Option<&'a Path> {
    const DEEPEST: usize = 12;
    if depth > DEEPEST {
        return None;
    }
    let mut here: Path = module.to_vec();
    let mut rest = path;
    match rest.first()?.as_str() {
        "crate" => {
            here.clear();
            rest = &rest[1..];
        }
        "self" => rest = &rest[1..],
        "super" => {
            while rest.first().is_some_and(|part| part == "super") {
                here.pop()?;
                rest = &rest[1..];
            }
        }
        first => {
            let child = [module, &[first.to_owned()]].concat();
            if !imports.contains_key(&child) {
                return None;
            }
        }
    }
    while let Some(name) = rest.first() {
        let child = [here.as_slice(), std::slice::from_ref(name)].concat();
        if imports.contains_key(&child) {
            here = child;
            rest = &rest[1..];
            continue;
        }
        let own = imports.get(&here)?;
        if let Some(handed) = own.iter().find(|import| import.is_public && import.name == *name) {
            let path = [handed.path.as_slice(), &rest[1..]].concat();
            return resolve(imports, &here, &path, depth + 1);
        }
        break;
    }
    imports.get_key_value(&here).map(|(module, _)| module)
}

fn imports(source: &Source) -> Vec<Import> {
    let mut found = Vec::new();
    let mut declaration = String::new();
    for (_, line) in source.code() {
        let head = line.trim_start();
        let begins = head.starts_with("use ") || (head.starts_with("pub") && head.contains(" use "));
        if declaration.is_empty() && !begins {
            continue;
        }
        declaration.push_str(head);
        declaration.push(' ');
        if head.ends_with(';') {
            let text = std::mem::take(&mut declaration);
            let is_public = text.starts_with("pub");
            let tree = text.split_once("use ").map_or("", |(_, tree)| tree).trim().trim_end_matches(';');
            flatten(tree, &[], is_public, &mut found);
        }
    }
    found
}

/// Parses `a::{b, c::d as e}`.
fn flatten(tree: &str, prefix: &[String], is_public: bool, found: &mut Vec<Import>) {
    let tree = tree.trim();
    if let Some((head, group)) = tree.split_once('{') {
        let head = head.split("::").map(str::trim).filter(|part| !part.is_empty()).map(str::to_owned);
        let prefix: Path = prefix.iter().cloned().chain(head).collect();
        let group = group.trim();
        let group = group.strip_suffix('}').unwrap_or(group);
        let mut depth = 0;
        let mut begin = 0;
        for (at, c) in group.char_indices().chain([(group.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 || at == group.len() => {
                    let part = &group[begin..at];
                    if !part.trim().is_empty() {
                        flatten(part, &prefix, is_public, found);
                    }
                    begin = (at + 1).min(group.len());
                }
                _ => {}
            }
        }
        return;
    }
    let (path, alias) = tree.split_once(" as ").map_or((tree, None), |(path, alias)| (path, Some(alias)));
    let own = path.split("::").map(|part| part.trim().to_owned());
    let mut path: Path = prefix.iter().cloned().chain(own).collect();
    if path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let name =
        alias.map(|alias| alias.trim().to_owned()).or_else(|| path.last().cloned()).unwrap_or_default();
    found.push(Import { path, name, is_public });
}
