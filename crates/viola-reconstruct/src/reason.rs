//! Reasons for a verdict, for programs and for people.

use serde::{Deserialize, Serialize};

/// A machine-readable reason for a verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// Stable identifier for programs, in snake case: `several_modes`, `too_few_hits`, `no_floor` ...
    pub code: String,
    /// Explanation for people.
    pub detail: String,
}

impl Reason {
    pub fn new(code: &str, detail: impl Into<String>) -> Reason {
        Reason { code: code.to_owned(), detail: detail.into() }
    }
}
