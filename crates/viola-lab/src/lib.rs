//! What measures and makes data: simulated homes with exact truth, the evaluation, and the paper's own method to compare with.

pub mod evaluate;
pub mod paper;
pub mod simulate;
