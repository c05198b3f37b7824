//! Parameters of the rays, and their hits.

use viola_geometry::{Point2, Vector2};

/// Surface above this is ceiling, lamps and beams.
pub(crate) const MAX_HEIGHT_M: f64 = 2.2;
/// Side of the cells of free space.
pub const FREE_CELL_M: f64 = 0.05;
/// Hits closer together than this are one.
pub const HIT_SPACING_M: f64 = 0.03;

/// Height of the vacuum's LiDAR above the floor; turrets are 7-12 cm, a bare sensor up to 15.
pub const VACUUM_HEIGHT_M: f64 = 0.12;

/// Parameters of the rays.
#[derive(Debug, Clone, PartialEq)]
pub struct RaycastParams {
    /// Height of the vacuum's LiDAR above the floor.
    pub vacuum_height_m: f64,
    /// Height of the floor in the clip frame: 0, unless another floor is tried.
    pub floor_m: f64,
}

impl Default for RaycastParams {
    fn default() -> Self {
        RaycastParams { vacuum_height_m: VACUUM_HEIGHT_M, floor_m: 0.0 }
    }
}

/// A first hit, in the clip frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub point_m: Point2,
    /// Unit length, towards the seen side.
    pub normal: Vector2,
    /// Weight as evidence, 0..1; [`crate::score::hit_weights`] sets it.
    pub weight: f64,
    /// Seen vertical extent of the column through it, bottom to top.
    pub extent_m: f64,
    /// True if seen at the vacuum's height; otherwise seen only above, and projected down along gravity.
    pub at_vacuum_height: bool,
    /// True if not seen but completed by [`crate::complete`].
    pub completed: bool,
    /// The start of the ray.
    pub from_m: Point2,
}

impl Hit {
    /// Returns the hit of a clip whose horizontal lengths are `factor` times as long.
    pub(crate) fn scaled(&self, factor: f64) -> Hit {
        Hit { point_m: self.point_m * factor, from_m: self.from_m * factor, ..*self }
    }

    /// Returns a hit on a wall of a metre with full weight, seen from the origin at the vacuum's height.
    pub fn standing(point_m: Point2, normal: Vector2) -> Hit {
        Hit {
            point_m,
            normal,
            weight: 1.0,
            extent_m: 1.0,
            at_vacuum_height: true,
            completed: false,
            from_m: Point2::origin(),
        }
    }
}
