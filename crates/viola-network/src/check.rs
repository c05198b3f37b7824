//! Checks of files and inputs before a runtime gets them, so that both runtimes return the same errors.

use super::tensor::{TensorInfo, shown};
use super::{MAX_MODEL_BYTES, NetworkError, Tensor};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Returns a file's name for messages; its folder is private to the host.
pub(super) fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Checks that a model file exists and has an allowed size.
pub(super) fn file(path: &Path) -> Result<(), NetworkError> {
    let unreadable = |source| NetworkError::Unreadable { file: name(path), source };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(unreadable(std::io::Error::other("it is not a file")));
    }
    match metadata.len() {
        0 => Err(NetworkError::NotANetwork { file: name(path), reason: "it is empty".to_owned() }),
        bytes if bytes > MAX_MODEL_BYTES => Err(NetworkError::TooLarge { file: name(path), bytes }),
        _ => Ok(()),
    }
}

/// Checks that each input of the network is given once, with its type and shape.
pub(super) fn inputs(expected: &[TensorInfo], given: &[(&str, Tensor)]) -> Result<(), NetworkError> {
    for info in expected {
        if !given.iter().any(|(name, _)| *name == info.name) {
            return Err(NetworkError::MissingInput { input: info.name.clone() });
        }
    }
    for (place, (name, tensor)) in given.iter().enumerate() {
        let Some(info) = expected.iter().find(|info| info.name == *name) else {
            let known: Vec<&str> = expected.iter().map(|info| info.name.as_str()).collect();
            return Err(NetworkError::UnknownInput { input: (*name).to_owned(), known: known.join(", ") });
        };
        if given[..place].iter().any(|(other, _)| other == name) {
            return Err(NetworkError::InputTwice { input: info.name.clone() });
        }
        input(info, tensor)?;
    }
    Ok(())
}

fn input(info: &TensorInfo, tensor: &Tensor) -> Result<(), NetworkError> {
    let element = tensor.data.element();
    if let Some(want) = info.element.filter(|want| *want != element) {
        return Err(NetworkError::InputType { input: info.name.clone(), want, got: element });
    }
    let fits = info.shape.as_ref().is_none_or(|axes| {
        axes.len() == tensor.shape.len()
            && axes.iter().zip(&tensor.shape).all(|(axis, got)| axis.is_none_or(|want| want == *got))
    });
    let count = tensor.shape.iter().try_fold(1usize, |all, n| all.checked_mul(*n));
    if !fits || count != Some(tensor.data.len()) {
        let got: Vec<Option<usize>> = tensor.shape.iter().map(|n| Some(*n)).collect();
        return Err(NetworkError::InputShape {
            input: info.name.clone(),
            want: info.shape.as_ref().map_or("any shape".to_owned(), shown),
            got: format!("{} with {} numbers", shown(&got), tensor.data.len()),
        });
    }
    Ok(())
}

/// Runs foreign code on an untrusted file, and returns a panic as an error.
pub(super) fn guarded<T>(
    work: impl FnOnce() -> Result<T, NetworkError>,
    broken: impl FnOnce(String) -> NetworkError,
) -> Result<T, NetworkError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let words = panic
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| panic.downcast_ref::<&str>().map(|words| (*words).to_owned()))
            .unwrap_or_default();
        Err(broken(format!("the runtime gave up on it: {words}")))
    })
}
