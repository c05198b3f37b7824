//! Why an answer is as it is, for programs and for people.

use serde::{Deserialize, Serialize};

/// A machine-readable reason for a verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Reason {
    /// Stable, in snake case, for programs: `several_modes`, `too_few_hits`, `no_floor` ...
    pub code: String,
    /// For people.
    pub detail: String,
}

impl Reason {
    pub fn new(code: &str, detail: impl Into<String>) -> Reason {
        Reason { code: code.to_owned(), detail: detail.into() }
    }
}
