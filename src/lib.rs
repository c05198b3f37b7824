//! The service and the command line of `viola`, which aligns short RGB-D clips of a home to the 2D LiDAR map
//! of its robot vacuum. The method and the storage are in the crates below `crates/`.
//!
//! The modules in reading order, lowest floor first. A module imports only from lower floors; `tests/house`
//! checks this.
//!
//! | floor | module | content |
//! |---|---|---|
//! | 8 | [`jobs`], [`webhooks`] | the queue and its workers; messages to other services |
//! | 9 | [`api`] | HTTP |
//! | 10 | [`cli`] | the command line |

pub mod api;
pub mod cli;
pub mod jobs;
pub mod webhooks;
