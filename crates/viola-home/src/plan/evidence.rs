//! Evidence of walls in the plan's frame: columns of upright surface that face one of four directions, and open
//! floor.

use super::columns::Columns;
use super::glass;
use super::raster::{glass_cells, is_level, is_wall_surface, level_cells, owners, upright_cells};
use super::standing::{Surface, standing_cells};
use super::uprights::{Upright, columns};
use crate::map_point::MapPoint;
use crate::objects::Object;
use crate::rooms::Room;
use crate::rooms::space::Space;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2, Vector2};

/// Heights of wall surface, in bins of `STOREY_M`.
pub(super) const LOWEST_M: f64 = 0.1;
const STOREY_M: f64 = 0.15;
/// Bins from 1.2 m on: furniture seldom reaches them.
const HIGH: u32 = !0 << 8;
const HEIGHTS: u32 = 16;
/// The LiDAR saw the column.
const BY_LIDAR: u32 = 1 << 16;
/// A door or window is in the column.
const OPENING: u32 = 1 << 17;
/// The opening is a window.
const WINDOW: u32 = 1 << 18;
/// Columns without a bit below 1.9 m may be the wall above a doorway.
const BELOW_LINTEL: u32 = (1 << 12) - 1;
/// Minimum number of heights of a column that reaches the ceiling.
const TALL: u32 = 8;
/// Bins from 2.05 m on: leaves of doors do not reach them.
const ABOVE_DOORS: u32 = !0 << 13;
/// Distances between the two faces of a wall.
const BACK_M: [f64; 2] = [0.04, 0.3];
/// Cosine between a point's normal and the direction that it faces.
const FACING: f64 = 0.8;

/// A direction that faces look into; their room is on this side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Facing {
    /// 0 if the faces stand across x, 1 across y.
    pub axis: usize,
    /// True if they look towards larger coordinates.
    pub up: bool,
}

impl Facing {
    pub const ALL: [Facing; 4] = [
        Facing { axis: 0, up: true },
        Facing { axis: 0, up: false },
        Facing { axis: 1, up: true },
        Facing { axis: 1, up: false },
    ];

    pub fn sign(self) -> f64 {
        if self.up { 1.0 } else { -1.0 }
    }

    pub fn normal(self) -> Vector2 {
        if self.axis == 0 { Vector2::new(self.sign(), 0.0) } else { Vector2::new(0.0, self.sign()) }
    }

    pub fn index(self) -> usize {
        2 * self.axis + usize::from(!self.up)
    }
}

/// Fraction of a wall that a column shows.
pub(super) fn fraction(bits: u32) -> f32 {
    let heights = bits & ((1 << HEIGHTS) - 1);
    let seen = heights.count_ones() + 2 * (heights & HIGH).count_ones();
    let seen = (seen as f32 / 8.0).min(1.0);
    if bits & BY_LIDAR != 0 { seen.max(0.8) } else { seen }
}

/// Number of heights at which the clips saw a column.
pub(super) fn heights(bits: u32) -> u32 {
    (bits & ((1 << HEIGHTS) - 1)).count_ones()
}

/// Returns the heights above all those that a column shows.
pub(super) fn above(bits: u32) -> u32 {
    let top = u32::BITS - (bits & ((1 << HEIGHTS) - 1)).leading_zeros();
    ((1 << HEIGHTS) - 1) & !((1 << top) - 1)
}

pub(super) fn by_lidar(bits: u32) -> bool {
    bits & BY_LIDAR != 0
}

pub(super) fn is_window(bits: u32) -> bool {
    bits & WINDOW != 0
}

/// Returns whether only the part of a wall above doors was seen.
pub(super) fn is_lintel(bits: u32) -> bool {
    bits != 0 && bits & (BELOW_LINTEL | BY_LIDAR) == 0
}

pub(super) fn is_opening(bits: u32) -> bool {
    bits & OPENING != 0
}

/// Returns whether a column shows wall up to the ceiling.
pub(super) fn is_tall(bits: u32) -> bool {
    heights(bits) >= TALL && heights(bits & ABOVE_DOORS) > 0
}

/// All evidence of a home, in the plan's frame.
pub(super) struct Evidence<'a> {
    pub map_from_plan: Pose2,
    pub plan_from_map: Pose2,
    pub low_m: [f64; 2],
    pub high_m: [f64; 2],
    pub columns: [Columns; 4],
    /// Columns of any direction.
    pub uprights: Vec<Upright>,
    space: &'a Space,
    /// Cells with floor, furniture from above, or ceiling, as clips saw it: no wall is there.
    level: Vec<bool>,
    /// Those with floor.
    floor: Vec<bool>,
    /// Cells that were seen through glass: nothing connects them with the rooms.
    beyond_glass: Vec<bool>,
    /// Cells with wall up to the ceiling.
    wall: Vec<bool>,
    /// Cells below standing furniture.
    standing: Vec<bool>,
    /// Directions of the upright surface that clips saw in each cell, as bits.
    directions: Vec<u8>,
    /// Index of the room of each cell of `space`, from 1; 0 for none.
    owner: Vec<u32>,
    /// The same of the rooms before people merged or divided some; none if nobody did.
    found: Option<Vec<u32>>,
    /// The room that stands for each room, by these indices.
    roots: Vec<u32>,
}

impl<'a> Evidence<'a> {
    /// `found` are the rooms before people corrected them. `roots` has the room that stands for each room, from index 1; see
    /// [`super::divide::roots`].
    pub fn new(
        map_from_plan: Pose2,
        space: &'a Space,
        points: &[MapPoint],
        found: &[Room],
        rooms: &[Room],
        roots: &[u32],
        objects: &[Object],
    ) -> Evidence<'a> {
        let plan_from_map = map_from_plan.inverse();
        let (mut low_m, mut high_m) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (level, floor) = level_cells(space, points);
        let owner = owners(space, rooms);
        let [before, after] = [found, rooms].map(|rooms| rooms.iter().map(|room| &room.polygon_m));
        let found = (!before.eq(after)).then(|| owners(space, found));
        let beyond_glass = glass::beyond(space, glass_cells(space, points), &level, &owner);
        let (wall, directions) = upright_cells(space, points);
        let standing = standing_cells(&Surface { space, level: &level, wall: &wall }, objects);
        for at in (0..space.frame.len()).filter(|at| space.occupied[*at] || space.free[*at] || floor[*at]) {
            let p = plan_from_map.apply(&space.centre(at));
            for axis in 0..2 {
                low_m[axis] = low_m[axis].min(p[axis]);
                high_m[axis] = high_m[axis].max(p[axis]);
            }
        }
        if low_m[0] > high_m[0] {
            (low_m, high_m) = ([0.0; 2], [0.0; 2]);
        }
        let by_facing = Facing::ALL.map(|facing| Columns::new(facing.axis, low_m, high_m));
        let mut evidence = Evidence {
            map_from_plan,
            plan_from_map,
            low_m,
            high_m,
            columns: by_facing,
            uprights: Vec::new(),
            space,
            level,
            floor,
            beyond_glass,
            wall,
            standing,
            directions,
            owner,
            found,
            roots: roots.to_vec(),
        };
        evidence.add_lidar();
        evidence.add_points(points);
        evidence.uprights = columns(std::mem::take(&mut evidence.uprights));
        evidence
    }

    fn add_lidar(&mut self) {
        let cell_m = self.space.frame.cell_m;
        for at in
            (0..self.space.frame.len()).filter(|at| self.space.occupied[*at] && !self.space.furniture[*at])
        {
            let p = self.plan_from_map.apply(&self.space.centre(at));
            self.uprights.push(Upright { at: p, bits: BY_LIDAR, normal: Vector2::zeros() });
            for facing in Facing::ALL {
                if self.is_free_before(&p, &facing.normal()) {
                    // A cell shows all of its width.
                    let along = [-0.5, 0.0, 0.5].map(|part| p[1 - facing.axis] + part * (cell_m - 1e-6));
                    for along in along {
                        self.columns[facing.index()].add([p[facing.axis], along], BY_LIDAR);
                    }
                }
            }
        }
    }

    fn add_points(&mut self, points: &[MapPoint]) {
        let is_opening = |point: &&MapPoint| matches!(point.point.label.class, Class::Door | Class::Window);
        let (openings, walls): (Vec<&MapPoint>, Vec<&MapPoint>) = points
            .iter()
            .filter(|point| f64::from(point.point.position_m[2]) >= LOWEST_M && !is_level(point))
            .filter(|point| is_opening(point) || is_wall_surface(point))
            .partition(is_opening);
        for point in walls {
            let bits = height(f64::from(point.point.position_m[2]));
            self.add_point(point, bits);
        }
        // An opening is one from both sides: wall behind it is the other face of the wall whose label is wrong.
        let bits = |point: &MapPoint| {
            let height = height(f64::from(point.point.position_m[2]));
            match point.point.label.class {
                _ if self.is_wall_behind(point, height) => height,
                Class::Window => OPENING | WINDOW,
                _ => OPENING,
            }
        };
        let bits: Vec<u32> = openings.iter().map(|point| bits(point)).collect();
        for (point, bits) in openings.iter().zip(bits) {
            self.add_point(point, bits);
        }
    }

    fn add_point(&mut self, point: &MapPoint, bits: u32) {
        let (at, normal) = self.in_plan(point);
        if let Some(normal) = normal.try_normalize(0.5) {
            self.uprights.push(Upright { at, bits, normal });
        }
        for facing in Facing::ALL.into_iter().filter(|f| f.normal().dot(&normal) > FACING) {
            self.columns[facing.index()].add([at[facing.axis], at[1 - facing.axis]], bits);
        }
    }

    /// Returns the place and the level part of the normal of a fused point.
    fn in_plan(&self, point: &MapPoint) -> (Point2, Vector2) {
        let [x, y, _] = point.point.position_m.map(f64::from);
        let normal = point.point.normal.map(f64::from);
        let level = Vector2::new(normal[0], normal[1]);
        (self.plan_from_map.apply(&Point2::new(x, y)), self.plan_from_map.rotate(&level))
    }

    /// Returns whether a wall behind a point shows its other face, at the same height.
    fn is_wall_behind(&self, point: &MapPoint, height: u32) -> bool {
        let (at, normal) = self.in_plan(point);
        Facing::ALL.into_iter().filter(|facing| facing.normal().dot(&normal) > FACING).any(|facing| {
            let opposite = Facing { up: !facing.up, ..facing };
            let columns = &self.columns[opposite.index()];
            let ends = BACK_M.map(|metres| at[facing.axis] - facing.sign() * metres);
            columns.between(ends, at[1 - facing.axis]) & height != 0
        })
    }

    /// Returns whether the robot saw open floor right before an occupied cell, in a direction.
    pub fn is_free_before(&self, in_plan: &Point2, towards: &Vector2) -> bool {
        let ahead = |cells: f64| self.cell(&(in_plan + towards * cells * self.cell_m()));
        let is_free = |cells: f64| ahead(cells).is_some_and(|at| self.space.free[at]);
        let is_blocked = ahead(1.1).is_none_or(|at| self.space.occupied[at]);
        !is_blocked && (is_free(1.1) || is_free(2.0))
    }

    /// Returns the side of the cells of the LiDAR map's raster.
    pub fn cell_m(&self) -> f64 {
        self.space.frame.cell_m
    }

    /// Returns the fraction of the columns of an interval of a face with a window in it.
    pub fn window_fraction(&self, facing: Facing, line_m: f64, span_m: [f64; 2]) -> f64 {
        self.fraction_of(facing, line_m, [-0.3, 0.1], span_m, is_window)
    }

    /// Returns the fraction of the columns of an interval of a face that show wall above doors.
    pub fn lintel_fraction(&self, facing: Facing, line_m: f64, span_m: [f64; 2]) -> f64 {
        self.fraction_of(facing, line_m, [-0.06, 0.06], span_m, |bits| heights(bits & !BELOW_LINTEL) > 0)
    }

    /// Returns the fraction of the columns of an interval of a face that show wall at many heights, to the ceiling or not.
    pub fn upright_fraction(&self, facing: Facing, line_m: f64, span_m: [f64; 2]) -> f64 {
        self.fraction_of(facing, line_m, [-0.06, 0.06], span_m, |bits| heights(bits) >= TALL)
    }

    /// Returns the fraction of the columns of an interval of a face that the LiDAR saw.
    pub fn lidar_fraction(&self, facing: Facing, line_m: f64, span_m: [f64; 2]) -> f64 {
        self.fraction_of(facing, line_m, [-0.06, 0.06], span_m, by_lidar)
    }

    /// Returns the fraction of the columns of an interval of a face that show wall up to the ceiling.
    pub fn tall_fraction(&self, facing: Facing, line_m: f64, span_m: [f64; 2]) -> f64 {
        self.fraction_of(facing, line_m, [-0.06, 0.06], span_m, is_tall)
    }

    /// `band_m` is the interval across the face, into its room.
    fn fraction_of(
        &self,
        facing: Facing,
        line_m: f64,
        band_m: [f64; 2],
        span_m: [f64; 2],
        is: impl Fn(u32) -> bool,
    ) -> f64 {
        let columns = &self.columns[facing.index()];
        let rows = columns.rows(band_m.map(|metres| line_m + facing.sign() * metres));
        let [from, to] = span_m.map(|metres| columns.columns_before(metres));
        let shown = (from..to).filter(|column| is(columns.band(rows.clone(), *column))).count();
        shown as f64 / (to - from.min(to)).max(1) as f64
    }

    fn cell(&self, in_plan: &Point2) -> Option<usize> {
        self.space.index(&self.map_from_plan.apply(in_plan))
    }

    /// Returns whether the robot or a clip saw open floor at a place.
    pub fn is_open(&self, in_plan: &Point2) -> bool {
        self.cell(in_plan).is_some_and(|at| (self.space.free[at] || self.level[at]) && !self.beyond_glass[at])
    }

    /// Returns whether the LiDAR map has cells, which tell open floor on both sides of a wall.
    pub fn has_cells(&self) -> bool {
        self.space.has_cells
    }

    /// Returns whether a clip saw a level surface at a place.
    pub fn is_level(&self, in_plan: &Point2) -> bool {
        self.cell(in_plan).is_some_and(|at| self.level[at] && !self.beyond_glass[at])
    }

    /// Returns whether wall up to the ceiling stands at a place.
    pub fn is_wall(&self, in_plan: &Point2) -> bool {
        self.cell(in_plan).is_some_and(|at| self.wall[at])
    }

    /// Returns whether standing furniture hides the floor of a place.
    pub fn is_below_furniture(&self, in_plan: &Point2) -> bool {
        self.cell(in_plan).is_some_and(|at| self.standing[at])
    }

    /// Returns whether clips saw upright surface of one of some directions at a place of the map's frame.
    pub fn has_upright(&self, in_map: &Point2, directions: u8) -> bool {
        self.space.index(in_map).is_some_and(|at| self.directions[at] & directions != 0)
    }

    /// Returns whether the robot or a clip saw floor at a place.
    pub fn is_floor(&self, in_plan: &Point2) -> bool {
        self.cell(in_plan).is_some_and(|at| self.space.free[at] || self.floor[at])
    }

    /// Returns whether a clip saw floor at a place.
    pub fn is_floor_of_clips(&self, in_plan: &Point2) -> bool {
        self.cell(in_plan).is_some_and(|at| self.floor[at])
    }

    /// Returns the room at a place: its index plus one; 0 for none. Rooms that lines of people divide are the first one of them.
    pub fn room(&self, in_plan: &Point2) -> u32 {
        self.roots[self.divided_room(in_plan) as usize]
    }

    /// Returns the room at a place before people merged or divided some: its index plus one; 0 for none. None if nobody did.
    pub fn found_room(&self, in_plan: &Point2) -> Option<u32> {
        let found = self.found.as_ref()?;
        Some(self.cell(in_plan).map_or(0, |at| found[at]))
    }

    /// Returns the room at a place with the lines of people: its index plus one; 0 for none.
    pub fn divided_room(&self, in_plan: &Point2) -> u32 {
        self.cell(in_plan).map_or(0, |at| self.owner[at])
    }
}

/// Returns the bit of a height.
pub(super) fn height(z: f64) -> u32 {
    1u32 << (((z - LOWEST_M) / STOREY_M) as u32).min(HEIGHTS - 1)
}
