//! The build context of the image: it contains every file that the build reads.

use std::fs;
use std::path::Path;

/// Folders and files that `docker/Dockerfile` compiles.
const READ: [&str; 6] = ["build.rs", "crates", "migrations", "models", "src", "web/src"];

/// Returns true if a pattern of `.dockerignore` leaves out a path of the repository. Our patterns are paths from the root,
/// a name in any folder, or the end of a name in any folder.
fn ignores(pattern: &str, path: &Path) -> bool {
    match pattern.strip_prefix("**/") {
        Some(name) => path.components().any(|part| match name.strip_prefix('*') {
            Some(end) => part.as_os_str().to_string_lossy().ends_with(end),
            None => part.as_os_str() == name,
        }),
        None => path.starts_with(pattern),
    }
}

fn check(path: &Path, root: &Path, patterns: &[&str]) {
    let within = path.strip_prefix(root).unwrap();
    if let Some(pattern) = patterns.iter().find(|pattern| ignores(pattern, within)) {
        panic!("{} is left out of the image's build by {pattern:?} in .dockerignore", within.display());
    }
    if path.is_dir() {
        fs::read_dir(path).unwrap().for_each(|entry| check(&entry.unwrap().path(), root, patterns));
    }
}

#[test]
fn the_images_build_has_all_sources() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join(".dockerignore")).unwrap();
    let patterns: Vec<&str> =
        text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
    for pattern in &patterns {
        let name = pattern.strip_prefix("**/*").or(pattern.strip_prefix("**/")).unwrap_or(pattern);
        assert!(!name.contains(['*', '!', '?']), "this test does not know the pattern {pattern:?}");
    }
    READ.iter().for_each(|path| check(&root.join(path), root, &patterns));
}
