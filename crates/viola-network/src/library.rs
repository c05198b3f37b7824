//! Search, check and loading of the ONNX Runtime library.
//!
//! A process loads at most one such library and never unloads it. A library is probed first, because the
//! binding crate ends the program if the library lacks its interface.

use super::{NetworkError, check};
use libloading::{Library, Symbol};
use ort::environment::Environment;
use ort::sys::{ORT_API_VERSION, OrtApiBase};
use std::ffi::CStr;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Folders in which packages install the library.
const USUAL: &[&str] = &[
    "/usr/local/lib",
    "/usr/local/lib64",
    "/usr/lib",
    "/usr/lib64",
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
    "/opt/onnxruntime/lib",
    "/opt/homebrew/lib",
];

/// The library that this process has loaded.
pub(super) struct OnnxRuntime {
    pub(super) environment: Environment,
    pub(super) version: String,
    path: PathBuf,
}

static LOADED: OnceLock<OnnxRuntime> = OnceLock::new();
static LOADING: Mutex<()> = Mutex::new(());

/// Loads the library, or returns it if it is loaded already.
pub(super) fn load(path: &Path) -> Result<&'static OnnxRuntime, NetworkError> {
    let whole = std::fs::canonicalize(path)
        .map_err(|source| NetworkError::LibraryMissing { path: path.to_owned(), source })?;
    let _turn = LOADING.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(loaded) = LOADED.get() {
        return if loaded.path == whole {
            Ok(loaded)
        } else {
            Err(NetworkError::LibraryOther { loaded: loaded.path.clone(), asked: whole })
        };
    }
    let version = probe(&whole)?;
    let broken = |reason: String| NetworkError::LibraryBroken { path: whole.clone(), reason };
    let environment = check::guarded(
        || {
            ort::init_from(&whole)
                .map_err(|error| broken(error.to_string()))?
                .with_name("viola")
                .with_telemetry(false)
                // No log: the errors hold the messages.
                .with_logger(std::sync::Arc::new(|_, _, _, _, _| {}))
                .build()
                .map_err(|error| broken(error.to_string()))
        },
        broken,
    )?;
    Ok(LOADED.get_or_init(|| OnnxRuntime { environment, version, path: whole }))
}

/// Returns the version of a library that has the required interface.
fn probe(path: &Path) -> Result<String, NetworkError> {
    let broken = |reason: &dyn std::fmt::Display| NetworkError::LibraryBroken {
        path: path.to_owned(),
        reason: reason.to_string(),
    };
    // SAFETY: loading runs the library's own code; the user who names a library trusts it like this program.
    let library = unsafe { Library::new(path) }.map_err(|error| {
        // The error's cause holds the message of the system's loader.
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        broken(&cause.unwrap_or_else(|| error.to_string()))
    })?;
    // SAFETY: the symbol, where it exists, is the documented entry point of ONNX Runtime and of this type.
    let entry: Symbol<unsafe extern "system" fn() -> *const OrtApiBase> =
        unsafe { library.get(b"OrtGetApiBase\0") }
            .map_err(|_| broken(&"it has no OrtGetApiBase, so it is not ONNX Runtime"))?;
    // SAFETY: the entry point takes no arguments and returns null or a table that lives as long as the
    // library; the version is a zero-terminated text.
    let (version, interface) = unsafe {
        let base = entry();
        if base.is_null() {
            return Err(broken(&"it offers no interface"));
        }
        let text = ((*base).GetVersionString)();
        if text.is_null() {
            return Err(broken(&"it does not tell its version"));
        }
        let version = CStr::from_ptr(text).to_string_lossy().into_owned();
        // Version 1.n has the interfaces up to n; a request for a newer one prints a warning.
        let mut parts = version.split('.').map_while(|part| part.parse::<u32>().ok());
        if (parts.next(), parts.next()) < (Some(1), Some(ORT_API_VERSION)) {
            return Err(NetworkError::LibraryTooOld {
                path: path.to_owned(),
                version,
                needed: format!("1.{ORT_API_VERSION}"),
            });
        }
        (version, ((*base).GetApi)(ORT_API_VERSION))
    };
    if interface.is_null() {
        return Err(broken(&format!("version {version} does not offer interface {ORT_API_VERSION}")));
    }
    Ok(version)
}

/// Finds the library in the given folders, or in the usual folders of the system.
pub(super) fn find(look_in: &[PathBuf]) -> Option<PathBuf> {
    look_in.iter().map(PathBuf::as_path).chain(USUAL.iter().map(Path::new)).find_map(in_folder)
}

/// Returns the searched folders, for messages.
pub(super) fn places(look_in: &[PathBuf]) -> String {
    let own = look_in.iter().map(|path| path.display().to_string());
    own.chain(USUAL.iter().map(|path| (*path).to_owned())).collect::<Vec<_>>().join(", ")
}

/// Returns the folder's library: the name without a version first, then the newest version.
fn in_folder(folder: &Path) -> Option<PathBuf> {
    let mut found: Vec<(bool, Vec<u32>, PathBuf)> = std::fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let name = entry.file_name().into_string().ok()?;
            let numbers = name.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect();
            let plain = ["libonnxruntime.so", "libonnxruntime.dylib", "onnxruntime.dll"].contains(&&*name);
            let versioned = name.starts_with("libonnxruntime.so.")
                || (name.starts_with("libonnxruntime.") && name.ends_with(".dylib"));
            (plain || versioned).then(|| (plain, numbers, entry.path()))
        })
        .filter(|(_, _, path)| path.is_file())
        .collect();
    found.sort();
    found.pop().map(|(_, _, path)| path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plain_name_then_the_newest() {
        let folder = tempfile::tempdir().unwrap();
        let find = || find(&[folder.path().to_owned()]).map(|path| path.file_name().unwrap().to_owned());
        let put = |name: &str| std::fs::write(folder.path().join(name), b"").unwrap();
        put("libonnxruntime_providers_shared.so");
        put("libonnxruntime.so.1.9.0");
        assert_eq!(find().unwrap(), "libonnxruntime.so.1.9.0");
        put("libonnxruntime.so.1.31.1");
        assert_eq!(find().unwrap(), "libonnxruntime.so.1.31.1");
        put("libonnxruntime.so");
        assert_eq!(find().unwrap(), "libonnxruntime.so");
    }
}
