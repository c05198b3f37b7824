//! Simulated homes with exact truth, the evaluation, and the paper's own method as its baseline.

pub mod evaluate;
mod mesh;
pub mod paper;
pub mod simulate;
pub mod surfaces;
