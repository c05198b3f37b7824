//! Shared parts of the tests: a client, recordings to upload, an S3 endpoint, PostgreSQL schemas, disks to
//! fill, waiting with a deadline, and a list of skipped tests.

pub mod client;
pub mod data;
pub mod disk;
pub mod files;
mod node;
pub mod postgres;
pub mod process;
mod receiver;
pub mod room;
pub mod s3_server;
mod skip;
pub mod tablespace;
pub mod tus;
mod wait;
pub mod zips;

pub use node::has_node;
pub use receiver::receiver;
pub use skip::skipped;
pub use wait::{eventually, until};
