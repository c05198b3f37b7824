//! Arguments that several commands share.

mod completion;
pub mod levels;
mod method;
mod networks;
pub mod numbers;
mod runtime;
mod seconds;
mod store;
mod worker;

pub use method::MethodArguments;
pub use networks::{NO_NETWORKS, NetworkArguments};
pub use runtime::RuntimeArguments;
pub use seconds::{patience_seconds, seconds};
pub use store::StoreArguments;
pub use worker::WorkerArguments;

use clap::error::ErrorKind;

/// Returns an error about the arguments: the process prints it as clap prints its own and ends with code 2.
pub fn wrong_arguments(text: impl std::fmt::Display) -> anyhow::Error {
    clap::Error::raw(ErrorKind::ValueValidation, format!("{text}\n")).into()
}
