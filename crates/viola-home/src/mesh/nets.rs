//! Surface nets (Gibson, "Constrained elastic surface nets", 1998): one vertex in each cell that the surface
//! passes, one quadrilateral for each edge of the grid that it crosses.

use super::field::{BLOCK, Field, Sample, block_of, corner};
use crate::MAP_VOXEL_M;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The weight that the best corner of a cell needs at a step of [`MAP_VOXEL_M`]. On a plane of one point for each 3 cm it
/// is 6.5, at the plane's open edge 3.3; less is a hole.
const MIN_WEIGHT: f32 = 2.0;
const CELLS: usize = (BLOCK * BLOCK * BLOCK) as usize;
const NONE: u32 = u32::MAX;

type V = Vector3<f32>;

/// Positions and triangles of a surface.
pub struct Net {
    pub positions_m: Vec<[f32; 3]>,
    /// Counter-clockwise, seen from the observed side.
    pub triangles: Vec<[u32; 3]>,
}

/// Vertices of the cells in one block.
struct Cells {
    of_cell: Vec<u32>,
    positions_m: Vec<[f32; 3]>,
}

pub fn net(field: &Field) -> Net {
    let mut cells: Vec<Cells> = field.blocks.par_iter().map(|(key, _)| cells(field, *key)).collect();
    let mut positions_m = Vec::new();
    for block in &mut cells {
        let first = positions_m.len() as u32;
        block.of_cell.iter_mut().filter(|vertex| **vertex != NONE).for_each(|vertex| *vertex += first);
        positions_m.append(&mut block.positions_m);
    }
    let vertex = |cell: [i32; 3]| {
        let block = field.block(block_of(cell))?;
        let vertex = cells[block as usize].of_cell[corner(cell)];
        (vertex != NONE).then_some(vertex)
    };
    let triangles: Vec<Vec<[u32; 3]>> =
        field.blocks.par_iter().map(|(key, _)| triangles(field, *key, &vertex, &positions_m)).collect();
    Net { positions_m, triangles: triangles.concat() }
}

fn places(key: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let first = key.map(|c| c * BLOCK);
    (0..BLOCK).flat_map(move |z| {
        (0..BLOCK).flat_map(move |y| (0..BLOCK).map(move |x| [first[0] + x, first[1] + y, first[2] + z]))
    })
}

fn moved(place: [i32; 3], by: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|axis| place[axis] + by[axis])
}

fn cells(field: &Field, key: [i32; 3]) -> Cells {
    let mut of_cell = vec![NONE; CELLS];
    let mut positions_m = Vec::new();
    for cell in places(key) {
        if let Some(position_m) = vertex_in(field, cell) {
            of_cell[corner(cell)] = positions_m.len() as u32;
            positions_m.push(position_m);
        }
    }
    Cells { of_cell, positions_m }
}

/// Returns the mean of the places where the surface crosses a cell's edges.
fn vertex_in(field: &Field, cell: [i32; 3]) -> Option<[f32; 3]> {
    let offset = |index: usize| [index & 1, (index >> 1) & 1, (index >> 2) & 1].map(|c| c as i32);
    let mut distances = [0.0_f32; 8];
    let mut best_weight = 0.0_f32;
    for (index, distance) in distances.iter_mut().enumerate() {
        let sample = field.at(moved(cell, offset(index)))?;
        *distance = sample.distance_m;
        best_weight = best_weight.max(sample.weight);
    }
    // A coarser grid sums more points.
    if best_weight < MIN_WEIGHT * (field.step_m / MAP_VOXEL_M as f32).powi(2) {
        return None;
    }
    let (mut sum, mut count) = ([0.0_f32; 3], 0_u16);
    for a in 0..8_usize {
        for axis in 0..3 {
            let b = a | (1 << axis);
            if a == b || (distances[a] < 0.0) == (distances[b] < 0.0) {
                continue;
            }
            let fraction = distances[a] / (distances[a] - distances[b]);
            let from = offset(a);
            for (other, sum) in sum.iter_mut().enumerate() {
                *sum += from[other] as f32 + if other == axis { fraction } else { 0.0 };
            }
            count += 1;
        }
    }
    (count > 0).then(|| {
        std::array::from_fn(|axis| (cell[axis] as f32 + sum[axis] / f32::from(count)) * field.step_m)
    })
}

fn triangles(
    field: &Field,
    key: [i32; 3],
    vertex: &(impl Fn([i32; 3]) -> Option<u32> + Sync),
    positions_m: &[[f32; 3]],
) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for place in places(key) {
        let Some(here) = field.at(place) else { continue };
        for axis in 0..3 {
            let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
            let step = |of: usize, by: i32| std::array::from_fn(|c| if c == of { by } else { 0 });
            let Some(there) = field.at(moved(place, step(axis, 1))) else { continue };
            if (here.distance_m < 0.0) == (there.distance_m < 0.0) {
                continue;
            }
            // The four cells around the edge, counter-clockwise as seen against the axis.
            let around = [[-1, -1], [0, -1], [0, 0], [-1, 0]]
                .map(|[du, dv]| vertex(moved(moved(place, step(u, du)), step(v, dv))));
            let [Some(a), Some(b), Some(c), Some(d)] = around else { continue };
            // The observed side has positive distances.
            let quad = if here.distance_m < 0.0 { [a, b, c, d] } else { [d, c, b, a] };
            if !was_observed(quad.map(|vertex| positions_m[vertex as usize]), &here, &there) {
                continue;
            }
            triangles.push([quad[0], quad[1], quad[2]]);
            triangles.push([quad[0], quad[2], quad[3]]);
        }
    }
    triangles
}

/// Checks that a quadrilateral faces the way of the points' normals at its edge of the grid.
///
/// Between two sheets that face the same way, such as a wall that two clips have some centimetres apart, the distance to
/// the front sheet is negative and the distance to the back sheet is positive. The sign changes there without a surface.
fn was_observed(quad: [[f32; 3]; 4], here: &Sample, there: &Sample) -> bool {
    let [a, b, c, d] = quad.map(V::from);
    let front = (c - a).cross(&(d - b));
    // The normal where the distance is zero.
    let normal =
        V::from(here.normal) * there.distance_m.abs() + V::from(there.normal) * here.distance_m.abs();
    front.dot(&normal) >= 0.0
}
