//! Errors of opening and running a network.

use super::tensor::Element;
use std::path::PathBuf;

/// Maximum size of a model file in bytes: the weights stay in memory as long as the network.
pub const MAX_MODEL_BYTES: u64 = 4 << 30;

#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    #[error("the model file {file} cannot be read: {source}")]
    Unreadable { file: String, source: std::io::Error },
    #[error("the model file {file} has {bytes} bytes; at most {MAX_MODEL_BYTES} are loaded")]
    TooLarge { file: String, bytes: u64 },
    #[error("{file} is not an ONNX model that this runtime can load: {reason}; get the whole file again")]
    NotANetwork { file: String, reason: String },
    #[error("the network's input {input} is not given")]
    MissingInput { input: String },
    #[error("the network has no input {input}; it has {known}")]
    UnknownInput { input: String, known: String },
    #[error("the network's input {input} is given twice")]
    InputTwice { input: String },
    #[error("the network's input {input} takes {want:?} numbers, not {got:?}")]
    InputType { input: String, want: Element, got: Element },
    #[error("the network's input {input} takes {want}, not {got}")]
    InputShape { input: String, want: String, got: String },
    #[error("a number of the network's input {input} is too large for this runtime")]
    InputRange { input: String },
    #[error("the network's output {output} is of a type that cannot be read")]
    OutputType { output: String },
    #[error("the network failed: {reason}")]
    Run { reason: String },
    #[error("the library of ONNX Runtime, {path}, cannot be read: {source}")]
    LibraryMissing { path: PathBuf, source: std::io::Error },
    #[error(
        "no library of ONNX Runtime is found in {places}; fetch it with `viola models fetch onnxruntime`, \
         or name it in ORT_DYLIB_PATH"
    )]
    LibraryNowhere { places: String },
    #[error("{path} is no usable library of ONNX Runtime: {reason}")]
    LibraryBroken { path: PathBuf, reason: String },
    #[error("{path} is ONNX Runtime {version}, which is too old; {needed} or newer is needed")]
    LibraryTooOld { path: PathBuf, version: String, needed: String },
    #[error("{loaded} is loaded already, and a process can have one ONNX Runtime only; {asked} is not taken")]
    LibraryOther { loaded: PathBuf, asked: PathBuf },
    #[error("{device} cannot be used: {reason}")]
    Device { device: &'static str, reason: String },
}
