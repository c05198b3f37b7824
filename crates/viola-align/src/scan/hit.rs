//! Rays: how they are cast, and what they hit.

use viola_geometry::{Point2, Vector2};

/// How rays are cast.
#[derive(Debug, Clone, PartialEq)]
pub struct RaycastParams {
    /// Height of the vacuum's LiDAR above the floor; turrets are 7-12 cm, a bare sensor up to 15.
    pub vacuum_height_m: f64,
    /// Height of the floor in the clip frame: 0, unless another floor is tried.
    pub floor_m: f64,
    /// Surface this far above and below counts as being at that height (the authors' slab).
    pub slab_m: f64,
    /// A surface whose normal leans at least this much towards the vertical is no obstacle.
    pub max_normal_z: f64,
    /// Rays in a full turn.
    pub rays: usize,
    /// Side of the columns in which the vertical extent of what stands is measured.
    pub column_m: f64,
    /// A column seen only above the slab counts as a wall down to the floor if at least this much of it
    /// was seen.
    pub min_upper_extent_m: f64,
    /// Surface above this is ceiling, lamps and beams.
    pub max_height_m: f64,
    /// Hits closer together than this are one.
    pub hit_spacing_m: f64,
    pub max_hits: usize,
    /// Longest ray.
    pub max_range_m: f64,
    /// Side of the cells in which free space is remembered.
    pub free_cell_m: f64,
}

impl Default for RaycastParams {
    fn default() -> Self {
        RaycastParams {
            vacuum_height_m: 0.12,
            floor_m: 0.0,
            slab_m: 0.10,
            max_normal_z: 0.6,
            rays: 720,
            column_m: 0.06,
            min_upper_extent_m: 0.35,
            max_height_m: 2.2,
            hit_spacing_m: 0.03,
            max_hits: 500,
            max_range_m: 8.0,
            free_cell_m: 0.05,
        }
    }
}

/// A first hit, in the clip frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub point_m: Point2,
    /// Unit length, towards the seen side.
    pub normal: Vector2,
    /// How much it counts as evidence, 0..1; [`crate::score::hit_weights`] sets it.
    pub weight: f64,
    /// How much of the column through it was seen standing, bottom to top.
    pub extent_m: f64,
    /// Seen at the vacuum's height; otherwise only above, and projected down along gravity.
    pub at_vacuum_height: bool,
    /// Not seen but filled in by [`crate::complete`].
    pub completed: bool,
    /// Where the ray began.
    pub from_m: Point2,
}

#[cfg(test)]
impl Hit {
    /// On a wall, seen from the origin, that counts in full.
    pub(crate) fn standing(point_m: Point2, normal: Vector2) -> Hit {
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
