//! A home's floor plan, made of the LiDAR map and the fused map together. Every format is drawn from one model.
//!
//! Straight faces of walls divide the plane into cells (`faces`, `cells`). A minimum cut tells which cells are
//! inside: its border runs along faces that were seen, and crosses open floor nowhere. Gaps in walls are closed
//! (`gaps`), and what remains connected is a room (`spaces`), so rooms are closed and never overlap.

mod axes;
mod backs;
mod bites;
mod cells;
mod columns;
mod cut;
mod direction;
mod divide;
mod dxf;
mod evidence;
mod faces;
mod filmed;
mod fixtures;
mod furnish;
mod gaps;
mod geojson;
mod glass;
mod glazed;
mod islands;
mod masonry;
mod merges;
mod model;
mod oblique;
mod page;
mod passages;
mod raster;
mod recess;
mod ring;
mod shape;
mod spaces;
mod standing;
mod straighten;
mod symbols;
mod thin;
mod uprights;
mod whole;

use super::corrections::RoomDivision;
use super::map_point::MapPoint;
use super::objects::Object;
use super::rooms::Room;
use super::rooms::bands::Bands;
use super::rooms::outline::{Outline, distance_m};
use super::rooms::space::Space;
use axes::{sample, span};
use cells::Cells;
use evidence::Evidence;
use merges::Merges;
use spaces::Spaces;
use viola_formats::lidar::LidarMap;
use viola_geometry::{LevelName, Point2, Pose2};

pub use dxf::plan_dxf;
pub use geojson::{plan_geojson, plan_json};
pub use model::{Furniture, Opening, OpeningKind, Plan, PlanRoom, Swing, Wall};
pub use page::image::PlanImage;
pub use page::pdf::plan_pdf;
pub use page::svg::{plan_png, plan_svg};

/// Returns the plan of a home. `points` is its fused map; it may be empty.
pub fn plan(lidar: &LidarMap, points: &[MapPoint], rooms: &[Room], objects: &[Object]) -> Plan {
    plan_of_corrected(&Ground::new(lidar, points), points, rooms, &Revised { rooms, objects, divisions: &[] })
}

/// The part of a plan that does not depend on rooms and objects.
pub(super) struct Ground {
    space: Space,
    map_from_plan: Pose2,
}

impl Ground {
    pub fn new(lidar: &LidarMap, points: &[MapPoint]) -> Ground {
        Ground {
            space: Space::reaching(lidar, points),
            map_from_plan: direction::map_from_plan(lidar, points),
        }
    }
}

/// Rooms and objects with the corrections of people.
pub(super) struct Revised<'a> {
    pub rooms: &'a [Room],
    pub objects: &'a [Object],
    /// Lines by which people divided rooms.
    pub divisions: &'a [RoomDivision],
}

/// Returns the plan of a home whose rooms people may have merged or divided. `found` are the rooms before that.
pub(super) fn plan_of_corrected(
    ground: &Ground,
    points: &[MapPoint],
    found: &[Room],
    revised: &Revised,
) -> Plan {
    let Ground { space, map_from_plan } = ground;
    let map_from_plan = *map_from_plan;
    let given = revised.rooms;
    let roots = divide::roots(given, revised.divisions);
    let evidence = Evidence::new(map_from_plan, space, points, found, given, &roots, revised.objects);
    let mut faces = faces::faces(&evidence);
    thin::separate(&mut faces, &evidence);
    backs::add(&mut faces, &evidence, revised.objects);
    let mut oblique = oblique::faces(&evidence, &faces);
    thin::pair(&mut oblique);
    let faces = oblique::without_steps(faces, &oblique);
    let mut cells = Cells::new(&evidence, &faces, &oblique, given);
    bites::fill(&mut cells, &evidence);
    recess::close(&mut cells, &evidence);
    gaps::close_seams(&mut cells, &evidence, &faces);
    let merges = Merges::new(found, given, &roots);
    let spaces = Spaces::new(&mut cells, &evidence, &faces, &oblique, given, &merges);
    let mut outlines = shape::outlines(&cells, &spaces);
    let sides = straighten::straighten(&mut outlines, &oblique);
    let mut walls = shape::walls(&cells, &spaces, &outlines);
    let slanted = straighten::walls(&sides, &oblique);
    let openings = shape::doors(&spaces.gaps);
    let base = shape::masonry(&cells, &spaces);
    let masonry = masonry::with_oblique(base, &outlines, &walls, &slanted, &openings);
    walls.extend(slanted);
    for (number, wall) in (1..).zip(&mut walls) {
        wall.id = format!("wall-{number}");
        wall.filmed_fraction = filmed::fraction(wall, &openings, &evidence);
    }
    let unfilmed_masonry = masonry::unfilmed(&masonry, &filmed::parts(&walls, &openings, &evidence));
    let owned = outlines.into_iter().zip(&spaces.owners);
    let rooms: Vec<PlanRoom> = owned.map(|(outline, owner)| room(outline, *owner, given)).collect();
    let furniture = furnish::furniture(revised.objects, points, &rooms, &evidence.plan_from_map);
    let mut plan = Plan {
        level: LevelName::MAIN,
        home_name: None,
        map_from_plan,
        walls,
        masonry,
        unfilmed_masonry,
        openings,
        rooms,
        furniture,
    };
    fixtures::add(&mut plan, points);
    divide::divide(&mut plan, given, &roots, revised.divisions);
    plan
}

fn room(outline: Outline, owner: u32, rooms: &[Room]) -> PlanRoom {
    let given = (owner as usize).checked_sub(1).and_then(|at| rooms.get(at));
    PlanRoom {
        id: given.map(|room| room.id.clone()),
        name: given.and_then(|room| room.name.clone()),
        area_m2: outline.area_m2(),
        label_at_m: inner_point(&outline),
        outline,
    }
}

/// Returns a point in a polygon that is far from its border: the best of a raster, or a corner of a polygon that all rasters
/// miss.
fn inner_point(outline: &Outline) -> [f64; 2] {
    /// Places along each side of the box around it. A long corridor around a corner is narrower than the first ones are apart.
    const STEPS: [usize; 3] = [24, 96, 384];
    let found = STEPS.into_iter().find_map(|steps| innermost(outline, steps));
    found.or_else(|| outline.ring_m.first().copied()).unwrap_or_default()
}

/// Returns the place of a raster in a polygon that is furthest from its border; none if all are outside.
fn innermost(outline: &Outline, steps: usize) -> Option<[f64; 2]> {
    let span = span(&outline.ring_m);
    let bands = Bands::new(&outline.ring_m, &outline.holes_m);
    let mut best: Option<(f64, [f64; 2])> = None;
    for i in 0..steps * steps {
        let p = sample(span, steps, i);
        let point = Point2::from(p);
        if !bands.contains(&point) {
            continue;
        }
        let rings = std::iter::once(&outline.ring_m).chain(&outline.holes_m);
        let off_m = rings.map(|ring| distance_m(ring, &point)).fold(f64::INFINITY, f64::min);
        if best.is_none_or(|(most_m, _)| off_m > most_m + 1e-9) {
            best = Some((off_m, p));
        }
    }
    best.map(|(_, p)| p)
}

#[cfg(test)]
mod tests;
