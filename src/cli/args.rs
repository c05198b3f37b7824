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

pub use completion::CompletionArguments;
pub use method::MethodArguments;
pub use networks::{NO_NETWORKS, NetworkArguments};
pub use runtime::RuntimeArguments;
pub use seconds::seconds;
pub use store::StoreArguments;
pub use worker::WorkerArguments;
