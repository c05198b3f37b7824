//! Statistics of a home's map.

use super::MAP_VOXEL_M;
use super::assemble::TileInfo;
use serde::{Deserialize, Serialize};
use viola_geometry::taxonomy::{CLASSES, Class};

/// Statistics of a home's map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HomeMapInfo {
    pub points: usize,
    pub voxel_m: f64,
    /// Corners of its bounding box, in the LiDAR map's frame; null if it is empty or has several levels.
    pub min_m: Option<[f32; 3]>,
    pub max_m: Option<[f32; 3]>,
    /// Points by class, the largest first.
    pub classes: Vec<ClassCount>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClassCount {
    pub class: String,
    pub points: usize,
}

impl HomeMapInfo {
    /// Returns the statistics of all levels together.
    pub fn of_levels<'a>(mut levels: impl Iterator<Item = &'a HomeMapInfo>) -> HomeMapInfo {
        let Some(first) = levels.next() else { return HomeMapInfo::of(std::iter::empty()) };
        let mut all = first.clone();
        for level in levels {
            all.points += level.points;
            // The levels have frames of their own.
            (all.min_m, all.max_m) = (None, None);
            for count in &level.classes {
                match all.classes.iter_mut().find(|known| known.class == count.class) {
                    Some(known) => known.points += count.points,
                    None => all.classes.push(count.clone()),
                }
            }
        }
        all.classes.sort_by_key(|count| std::cmp::Reverse(count.points));
        all
    }

    pub fn of<'a>(tiles: impl Iterator<Item = &'a TileInfo>) -> HomeMapInfo {
        let mut info =
            HomeMapInfo { points: 0, voxel_m: MAP_VOXEL_M, min_m: None, max_m: None, classes: Vec::new() };
        let mut counts = [0usize; CLASSES];
        let corner = |known: Option<[f32; 3]>, of_tile: [f32; 3], pick: fn(f32, f32) -> f32| {
            Some(known.map_or(of_tile, |known| [0, 1, 2].map(|axis| pick(known[axis], of_tile[axis]))))
        };
        for tile in tiles {
            info.points += tile.points;
            info.min_m = corner(info.min_m, tile.min_m, f32::min);
            info.max_m = corner(info.max_m, tile.max_m, f32::max);
            counts.iter_mut().zip(&tile.classes).for_each(|(sum, count)| *sum += count);
        }
        let count = |class: &Class| ClassCount {
            class: class.name().to_owned(),
            points: counts[usize::from(class.id())],
        };
        info.classes = Class::ALL.iter().map(count).filter(|count| count.points > 0).collect();
        info.classes.sort_by_key(|count| std::cmp::Reverse(count.points));
        info
    }
}
