//! Distance of every floor position to the nearest obstacle.

use super::piece::Footprint;
use super::plan::Plan;
use super::scene::{Primitive, Scene};
use super::solid::Shape;
use viola_geometry::taxonomy::Class;
use viola_geometry::{DistanceField, Grid, GridFrame, Point3, Vector3};

/// Returns the distance to the nearest solid within the heights `band_m`, and to the outside of the rooms.
pub(super) fn clearance(scene: &Scene, plan: &Plan, cell_m: f64, band_m: [f64; 2]) -> DistanceField {
    let bounds = plan.bounds();
    let frame = GridFrame::covering(bounds.min, bounds.max, 0.3, cell_m);
    // The outside is blocked, even behind windows that reach the floor.
    let mut solid = Grid::filled(frame, true);
    for room in &plan.rooms {
        for (index, cell) in solid.cells.iter_mut().enumerate() {
            *cell &= !room.outline.contains(&frame.centre(index % frame.width, index / frame.width));
        }
    }
    for primitive in &scene.primitives {
        let in_the_way = primitive.high.z > band_m[0] && primitive.low.z < band_m[1];
        if in_the_way && primitive.class != Class::Floor {
            stamp(&mut solid, primitive, band_m);
        }
    }
    DistanceField::new(&solid)
}

/// Marks the cells that a solid covers. A sloped ceiling covers the cells where its underside is in the band.
fn stamp(grid: &mut Grid<bool>, primitive: &Primitive, band_m: [f64; 2]) {
    let frame = grid.frame;
    let cell = |value: f64, axis: usize, count: usize| {
        ((value - frame.origin_m[axis]) / frame.cell_m).clamp(0.0, count as f64 - 1.0) as usize
    };
    let pad = frame.cell_m / 2.0;
    let (x0, x1) =
        (cell(primitive.low.x - pad, 0, frame.width), cell(primitive.high.x + pad, 0, frame.width));
    let (y0, y1) =
        (cell(primitive.low.y - pad, 1, frame.height), cell(primitive.high.y + pad, 1, frame.height));
    let axes = &primitive.home_from_unit;
    // A leaning solid covers its bounding box at most.
    let upright = axes[(2, 0)].abs().max(axes[(2, 1)].abs()) < 0.01;
    let axis = axes.column(0);
    let spot = Footprint {
        centre: primitive.centre.xy(),
        half: [primitive.half.x + pad, primitive.half.y + pad],
        yaw_rad: axis.y.atan2(axis.x),
    };
    for y in y0..=y1 {
        for x in x0..=x1 {
            let centre = frame.centre(x, y);
            let is_low = || {
                let below = Point3::new(centre.x, centre.y, band_m[0]);
                let up = primitive.intersect(&below, &Vector3::z());
                up.is_some_and(|up| up < band_m[1] - band_m[0]) || primitive.contains(&below)
            };
            let covered = match primitive.shape {
                _ if primitive.class == Class::Ceiling => is_low(),
                _ if !upright => true,
                Shape::Block | Shape::Cushion | Shape::Mesh(_) => spot.contains(&centre),
                Shape::Cylinder | Shape::Ball => {
                    (centre - spot.centre).norm() <= primitive.half.x.max(primitive.half.y) + pad
                }
            };
            if covered {
                grid.set(x, y, true);
            }
        }
    }
}

/// Returns the largest connected region of the marked cells.
pub(super) fn largest_region(marked: &Grid<bool>) -> Grid<bool> {
    let frame = marked.frame;
    let fits = &marked.cells;
    let mut label = vec![0u32; fits.len()];
    let (mut best, mut best_size, mut next) = (0, 0, 0);
    for start in 0..fits.len() {
        if !fits[start] || label[start] != 0 {
            continue;
        }
        next += 1;
        let mut size = 0;
        let mut queue = vec![start];
        label[start] = next;
        while let Some(index) = queue.pop() {
            size += 1;
            let x = index % frame.width;
            let neighbours = [
                (x > 0).then(|| index - 1),
                (x + 1 < frame.width).then_some(index + 1),
                index.checked_sub(frame.width),
                Some(index + frame.width).filter(|n| *n < fits.len()),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if fits[neighbour] && label[neighbour] == 0 {
                    label[neighbour] = next;
                    queue.push(neighbour);
                }
            }
        }
        if size > best_size {
            (best, best_size) = (next, size);
        }
    }
    Grid { frame, cells: label.iter().map(|&l| l != 0 && l == best).collect() }
}
