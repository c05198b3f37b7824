//! Simulated homes with exact truth, the evaluation, the paper's own method as its baseline, and labelled surfaces for
//! training.

pub mod evaluate;
mod mesh;
mod pairs;
pub mod paper;
pub mod simulate;
pub mod surfaces;
