//! Gives vertices the normal, colour and class of the points around them.

use super::Vertex;
use super::field::dot;
use crate::light::GREY;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_geometry::voxels_around;
use viola_reconstruct::{CloudPoint, NO_COLOR};

/// Returns the vertices at `positions_m`; points within two steps are near.
pub fn dressed(positions_m: &[[f32; 3]], points: &[&CloudPoint], step_m: f32) -> Vec<Vertex> {
    let cell = |position_m: [f32; 3]| position_m.map(|c| (c / (2.0 * step_m)).floor() as i32);
    let mut cells: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
    for (index, point) in points.iter().enumerate() {
        cells.entry(cell(point.position_m)).or_default().push(index as u32);
    }
    let near = |position_m: [f32; 3]| {
        let keys = voxels_around(cell(position_m));
        keys.filter_map(|key| cells.get(&key)).flatten().map(|index| points[*index as usize])
    };
    let radius2_m2 = (2.0 * step_m).powi(2);
    positions_m.par_iter().map(|position_m| vertex(*position_m, radius2_m2, near(*position_m))).collect()
}

fn vertex<'a>(position_m: [f32; 3], radius2_m2: f32, near: impl Iterator<Item = &'a CloudPoint>) -> Vertex {
    let near: Vec<(f32, &CloudPoint)> = near
        .filter_map(|point| {
            let offset: [f32; 3] = std::array::from_fn(|axis| point.position_m[axis] - position_m[axis]);
            let distance2 = dot(offset, offset);
            (distance2 < radius2_m2).then(|| ((1.0 - distance2 / radius2_m2).powi(2), point))
        })
        .collect();
    // Ties go to the first point here, and to the class of the lowest id below.
    let nearest = near.iter().rev().max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, nearest)) = nearest else {
        return Vertex { position_m, normal: [0.0, 0.0, 1.0], color: GREY, class: Class::Other };
    };
    let (mut normal, mut color, mut colored) = ([0.0_f32; 3], [0.0_f32; 3], 0.0_f32);
    let mut votes = [0.0_f32; CLASSES];
    // The other side of a thin wall looks different.
    for (weight, point) in near.iter().filter(|(_, point)| dot(point.normal, nearest.normal) > 0.0) {
        normal.iter_mut().zip(point.normal).for_each(|(sum, c)| *sum += weight * c);
        if point.color != NO_COLOR {
            color.iter_mut().zip(point.color).for_each(|(sum, c)| *sum += weight * f32::from(c));
            colored += weight;
        }
        votes[usize::from(point.label.class.id())] += weight * (0.05 + point.label.probability());
    }
    let length = dot(normal, normal).sqrt();
    let best = votes.iter().zip(Class::ALL).rev().max_by(|a, b| a.0.total_cmp(b.0));
    Vertex {
        position_m,
        normal: if length > 1e-6 { normal.map(|c| c / length) } else { nearest.normal },
        color: if colored > 0.0 { color.map(|sum| (sum / colored).round() as u8) } else { GREY },
        class: best.map_or(Class::Other, |(_, class)| *class),
    }
}
