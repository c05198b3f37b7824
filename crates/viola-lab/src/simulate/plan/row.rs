//! Rows of look-alike rooms, as in a hotel or a nursing home.

use super::{Cell, Leaf, Opening, OpeningKind, Plan, Rect, RoomKind, UnitPlace, openings, snap};
use crate::simulate::rng::Rng;
use std::f64::consts::PI;
use viola_geometry::{Point2, Pose2};

/// Maximum area of the building, and maximum width of the lounge.
const LARGEST_M2: f64 = 200.0;
const LOUNGE_M: f64 = 4.8;

/// Sizes of one unit. In the unit's frame x is across, y from the window (0) to the corridor (`depth`); the
/// bathroom is at the corridor, at negative x.
struct Unit {
    width: f64,
    depth: f64,
    bath_width: f64,
    bath_depth: f64,
}

impl Unit {
    fn parts(&self) -> [(RoomKind, Rect); 3] {
        let (half, bath) = (self.width / 2.0, self.depth - self.bath_depth);
        [
            (RoomKind::Bedroom, Rect { min: [-half, 0.0], max: [half, bath] }),
            (RoomKind::Bathroom, Rect { min: [-half, bath], max: [self.bath_width - half, self.depth] }),
            (RoomKind::Corridor, Rect { min: [self.bath_width - half, bath], max: [half, self.depth] }),
        ]
    }
}

pub(super) fn layout(rng: &mut Rng) -> Plan {
    let unit = Unit {
        // Even multiples, so that its half is on the plan's raster, too.
        width: 2.0 * snap(rng.between(1.55, 2.1)),
        depth: snap(rng.between(4.8, 6.6)),
        bath_width: snap(rng.between(1.6, 1.9)),
        bath_depth: snap(rng.between(1.8, 2.4)),
    };
    let aisle = snap(rng.between(1.3, 1.8));
    let both_sides = rng.chance(0.6);
    let across = unit.depth * if both_sides { 2.0 } else { 1.0 } + aisle;
    let most = (LARGEST_M2 / across - LOUNGE_M) / unit.width;
    let columns = rng.count(2, 4).min(most as usize).max(2);
    let mirror_pairs = rng.chance(0.45);
    let mut units = vec![];
    for column in 0..columns {
        let x = snap(unit.width * (column as f64 + 0.5));
        let mirrored = mirror_pairs && column % 2 == 1;
        units.push(UnitPlace { mirrored, home_from_unit: Pose2::new(x, 0.0, 0.0) });
        if both_sides {
            let home_from_unit = Pose2::new(x, 2.0 * unit.depth + aisle, PI);
            units.push(UnitPlace { mirrored, home_from_unit });
        }
    }
    let mut cells = vec![];
    for (index, place) in units.iter().enumerate() {
        for (part, (kind, rect)) in unit.parts().into_iter().enumerate() {
            cells.push(Cell { kind, outline: moved(&rect, place), unit: Some((index, part)) });
        }
    }
    let length = unit.width * columns as f64;
    let (low, high) = (unit.depth, unit.depth + aisle);
    let corridor = Rect { min: [0.0, low], max: [length, high] };
    cells.push(Cell { kind: RoomKind::Corridor, outline: snapped(&corridor), unit: None });
    if rng.chance(0.7) {
        // A lounge across the corridor's end, as a distinctive place.
        let top = if both_sides { 2.0 * unit.depth + aisle } else { high };
        let reach = rng.between(3.5, LOUNGE_M);
        let lounge =
            Rect { min: [length, if both_sides { 0.0 } else { low - 2.5 }], max: [length + reach, top] };
        cells.push(Cell { kind: RoomKind::Living, outline: snapped(&lounge), unit: None });
    }
    let mut plan = Plan::with_walls(cells, rng);
    plan.units = units;
    open_units(&mut plan, &unit, &mut rng.fork("doors", 0));
    open_rest(&mut plan, rng);
    plan
}

fn snapped(rect: &Rect) -> Rect {
    Rect { min: rect.min.map(snap), max: rect.max.map(snap) }
}

fn placed(point: &Point2, place: &UnitPlace) -> Point2 {
    let x = if place.mirrored { -point.x } else { point.x };
    place.home_from_unit.apply(&Point2::new(x, point.y))
}

fn moved(rect: &Rect, place: &UnitPlace) -> Rect {
    let corners = [rect.min, rect.max].map(|corner| placed(&Point2::from(corner), place));
    snapped(&Rect::around(corners))
}

/// Adds the same openings to every unit.
fn open_units(plan: &mut Plan, unit: &Unit, rng: &mut Rng) {
    let (half, bath) = (unit.width / 2.0, unit.depth - unit.bath_depth);
    let entry = (unit.bath_width - half + half) / 2.0;
    let opening = |kind, x: f64, y: f64, along_x, width_m, sill_m, head_m, open_deg: f64| Opening {
        kind,
        centre: Point2::new(x, y),
        along_x,
        width_m,
        sill_m,
        head_m,
        rooms: [None, None],
        hinge: 1.0,
        swing: -1.0,
        open_rad: open_deg.to_radians(),
        leaf: Leaf::Hinged,
        detail: 0,
    };
    let entry_width = unit.width - unit.bath_width;
    let ceiling = plan.ceiling_m;
    let door_head = plan.head_limit_m().min(2.05);
    let template = [
        opening(OpeningKind::Door, entry, unit.depth, true, 0.85, 0.0, door_head, rng.between(72.0, 95.0)),
        opening(OpeningKind::Wide, entry, bath, true, entry_width - plan.wall_m, 0.0, ceiling, 0.0),
        opening(
            OpeningKind::Door,
            unit.bath_width - half,
            bath + unit.bath_depth / 2.0,
            false,
            0.75,
            0.0,
            door_head,
            rng.between(70.0, 90.0),
        ),
        opening(
            OpeningKind::Window,
            0.0,
            0.0,
            true,
            rng.between(1.2, unit.width - 0.9),
            rng.pick([0.05, 0.8, 0.9]),
            plan.head_limit_m().min(2.15),
            0.0,
        ),
    ];
    for place in &plan.units {
        let upside_down = place.home_from_unit.yaw_rad.abs() > 1.0;
        let flip_y = if upside_down { -1.0 } else { 1.0 };
        let flip_x = if place.mirrored { -flip_y } else { flip_y };
        for (index, base) in template.iter().enumerate() {
            let centre = placed(&base.centre, place);
            let (along, across) = if base.along_x { (flip_x, flip_y) } else { (flip_y, flip_x) };
            let snap_line = |p: Point2| {
                if base.along_x { Point2::new(p.x, snap(p.y)) } else { Point2::new(snap(p.x), p.y) }
            };
            let centre = snap_line(centre);
            let mut copy = Opening {
                centre,
                hinge: base.hinge * along,
                swing: base.swing * across,
                detail: rng.fork("detail", index as u64).seed(),
                ..*base
            };
            copy.rooms = rooms_beside(plan, &copy);
            plan.openings.push(copy);
        }
    }
}

fn rooms_beside(plan: &Plan, opening: &Opening) -> [Option<usize>; 2] {
    let step = if opening.along_x { Point2::new(0.0, 0.2) } else { Point2::new(0.2, 0.0) };
    [plan.room_at(&(opening.centre - step.coords)), plan.room_at(&(opening.centre + step.coords))]
}

/// Adds the lounge's way and the windows outside the units.
fn open_rest(plan: &mut Plan, rng: &mut Rng) {
    let mut rest = plan.clone();
    rest.openings.clear();
    let outside_units = |room: &Option<usize>| room.is_none_or(|r| plan.rooms[r].unit.is_none());
    rest.walls.retain(|wall| wall.rooms.iter().all(outside_units));
    openings::open_doors(&mut rest, &mut rng.fork("lounge", 0));
    openings::open_windows(&mut rest, false, &mut rng.fork("windows", 0));
    plan.openings.extend(rest.openings);
}
