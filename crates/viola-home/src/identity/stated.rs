//! Corrections of objects, as the matching of ids needs them.

use super::super::assemble::LookedThrough;
use super::super::objects::{Object, UprightBox};
use super::{evidence, likeness};
use std::collections::BTreeMap;

/// A corrected object.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// The box in which the object is shown.
    pub bounds: UprightBox,
    /// The box in which it was seen, if a person put it elsewhere.
    pub put_from: Option<UprightBox>,
    pub is_hidden: bool,
    /// Time of the newest correction.
    pub stated_at_ms: i64,
}

/// Corrected objects by id. Their ids are never forgotten.
pub type Stated = BTreeMap<String, Statement>;

impl Statement {
    /// Returns whether an object is what earlier clips saw in the place from which a person moved this one.
    pub(super) fn is_left_over(&self, object: &Object, looked: &LookedThrough) -> bool {
        let is_there = self.put_from.is_some_and(|from| likeness::fills(&from, object));
        is_there && !evidence::is_seen_after(&evidence::points_of(object, looked), self.stated_at_ms)
    }
}
