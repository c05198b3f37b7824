//! Bundles the viewer in `web/` into the folder that the binary embeds.
//!
//! Without Node.js, or when npm cannot fetch the packages, the build goes on with a warning and the binary holds a
//! page that says so. Nothing in `web/` is written but `node_modules`.

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Sources of the bundle; a folder stands for all files in it.
const SOURCES: &[&str] = &[
    "web/src",
    "web/build.mjs",
    "web/package.json",
    "web/package-lock.json",
    "web/.npmrc",
    "web/tsconfig.json",
];
const ABSENT: &str = "src/api/page/absent.html";

fn main() -> Result<(), Box<dyn Error>> {
    for path in SOURCES.iter().chain(&["build.rs", ABSENT]) {
        println!("cargo::rerun-if-changed={path}");
    }
    let root = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(std::env::var("OUT_DIR")?).join("viewer");
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    fs::create_dir_all(out.join("assets"))?;
    match packages(&root.join("web")) {
        Ok(()) => bundle(&root.join("web"), &out)?,
        Err(reason) => {
            println!("cargo::warning=the viewer is not in this binary: {reason}");
            fs::copy(root.join(ABSENT), out.join("index.html"))?;
        }
    }
    list(&out)
}

/// Sees that the packages of the lock file are there; what is missing, in words.
fn packages(web: &Path) -> Result<(), String> {
    let node = Command::new("node").arg("--version").output();
    if !node.is_ok_and(|answer| answer.status.success()) {
        return Err("Node.js was not found".to_owned());
    }
    // npm writes this file last.
    let installed = web.join("node_modules/.package-lock.json");
    let changed = |path: &Path| fs::metadata(path).and_then(|data| data.modified()).ok();
    if changed(&installed).is_some_and(|at| changed(&web.join("package-lock.json")) <= Some(at)) {
        return Ok(());
    }
    let answer = Command::new("npm").args(["ci", "--loglevel=error"]).current_dir(web).output();
    match answer {
        Ok(answer) if answer.status.success() => Ok(()),
        Ok(answer) => {
            // A path that is not there makes cargo try again at the next build.
            println!("cargo::rerun-if-changed=web/node_modules/.package-lock.json");
            let said = String::from_utf8_lossy(&answer.stderr).trim().replace('\n', "; ");
            Err(format!("npm ci failed: {said}"))
        }
        Err(error) => Err(format!("npm could not be run: {error}")),
    }
}

fn bundle(web: &Path, out: &Path) -> Result<(), Box<dyn Error>> {
    let answer = Command::new("node").arg("build.mjs").arg(out).current_dir(web).output()?;
    if answer.status.success() {
        return Ok(());
    }
    Err(format!("the viewer does not bundle:\n{}", String::from_utf8_lossy(&answer.stderr)).into())
}

/// Writes the list of what was made, as Rust.
fn list(out: &Path) -> Result<(), Box<dyn Error>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(out.join("assets"))? {
        names.push(entry?.file_name().into_string().map_err(|name| format!("{name:?} is not a plain name"))?);
    }
    names.sort();
    let mut text = format!("const INDEX: &[u8] = include_bytes!({:?});\n", out.join("index.html"));
    writeln!(text, "const ASSETS: &[(&str, &[u8])] = &[")?;
    for name in names {
        writeln!(text, "    ({name:?}, include_bytes!({:?})),", out.join("assets").join(&name))?;
    }
    writeln!(text, "];")?;
    fs::write(out.join("list.rs"), text)?;
    Ok(())
}
