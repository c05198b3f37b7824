//! Stages that run inside another stage.

use viola_geometry::progress::{Progress, Stage};

/// Progress that stays in the current stage.
pub(super) struct Within<'a>(pub &'a dyn Progress);

impl Progress for Within<'_> {
    fn enter(&self, _stage: Stage) {}

    fn advance(&self, _fraction: f64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}
