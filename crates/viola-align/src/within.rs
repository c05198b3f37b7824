//! Stages that run inside another stage.

use viola_geometry::progress::Progress;

/// Progress that stays in the current stage.
pub(super) struct Within<'a>(pub &'a dyn Progress);

impl Progress for Within<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}
