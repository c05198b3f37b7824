//! Why a network cannot be opened or run.

use super::{Element, MAX_MODEL_BYTES};

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
}
