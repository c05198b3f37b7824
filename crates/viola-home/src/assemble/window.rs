//! Windows of a level's map that are labelled at once.

use super::content::{self, Block};
use super::{Tile, TileKey};
use crate::{MAP_VOXEL_M, MapPoint};
use std::collections::BTreeMap;
use viola_geometry::LevelName;
use viola_reconstruct::label::{MapLabels, SegmentError, SurfaceNetwork, label_map};
use viola_reconstruct::{CloudPoint, Label, PointCloud};

/// Tiles along a window's side (4.8 m).
const TILES: i32 = 2;
/// Blocks of surface around a window that its labels depend on, too.
const MARGIN: i32 = 1;

/// Index of a window, in units of its side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Window {
    level: LevelName,
    x: i32,
    y: i32,
}

/// The labels of a window's tiles.
pub(super) struct WindowLabels {
    /// A label for each point of each tile.
    pub labels: Vec<(TileKey, Vec<Label>)>,
    pub failure: Option<SegmentError>,
}

impl Window {
    /// Returns the windows whose labels depend on a block.
    pub fn around(block: &Block) -> Vec<Window> {
        let side = TILES * content::SIDE;
        let range = |at: i32| (at - MARGIN).div_euclid(side)..=(at + MARGIN).div_euclid(side);
        let window = |x: i32, y: i32| Window { level: block.level, x, y };
        range(block.y).flat_map(|y| range(block.x).map(move |x| window(x, y))).collect()
    }

    fn depends_on(&self, block: &Block) -> bool {
        let side = TILES * content::SIDE;
        let near = |own: i32, at: i32| (own * side - MARGIN..(own + 1) * side + MARGIN).contains(&at);
        self.level == block.level && near(self.x, block.x) && near(self.y, block.y)
    }

    fn has(&self, tile: &TileKey) -> bool {
        [tile.x.div_euclid(TILES), tile.y.div_euclid(TILES)] == [self.x, self.y]
    }

    /// Returns the keys of its tiles and of those around it, which may not exist.
    fn tiles(&self) -> impl Iterator<Item = TileKey> + use<> {
        let Window { level, x, y } = *self;
        let range = |at: i32| at * TILES - 1..=(at + 1) * TILES;
        range(x).flat_map(move |x| range(y).map(move |y| TileKey { level, x, y }))
    }

    /// Returns the labels of its tiles.
    pub fn label(&self, tiles: &BTreeMap<TileKey, Tile>, network: Option<&SurfaceNetwork>) -> WindowLabels {
        let tiles: Vec<(TileKey, &Tile)> =
            self.tiles().filter_map(|key| Some((key, tiles.get(&key)?))).collect();
        if !tiles.iter().any(|(key, _)| self.has(key)) {
            return WindowLabels { labels: Vec::new(), failure: None };
        }
        let (own, others): (Vec<_>, Vec<_>) = tiles.into_iter().partition(|(key, _)| self.has(key));
        let cloud_point = |(point, label): (&MapPoint, &Label)| {
            self.own_point(&CloudPoint { label: *label, ..point.point })
        };
        let mut points = Vec::new();
        for (_, tile) in &own {
            points.extend(tile.points.iter().zip(&tile.of_clips).map(cloud_point));
        }
        let count = points.len();
        for (key, tile) in others {
            let near = tile.points.iter().zip(&tile.of_clips);
            let near = near.filter(|(point, _)| self.depends_on(&Block::of(&key, point)));
            points.extend(near.map(cloud_point));
        }
        let MapLabels { labels, failure } =
            label_map(&PointCloud { points, voxel_m: MAP_VOXEL_M }, count, network);
        let mut labels = labels.into_iter();
        let labels =
            own.into_iter().map(|(key, tile)| (key, labels.by_ref().take(tile.points.len()).collect()));
        WindowLabels { labels: labels.collect(), failure }
    }

    /// Returns a point in the frame of the window's middle: labels do not depend on the place of a window.
    fn own_point(&self, point: &CloudPoint) -> CloudPoint {
        let middle_m =
            [self.x, self.y].map(|at| (f64::from(at) + 0.5) * f64::from(TILES) * TileKey::side_m());
        let mut point = *point;
        for (axis, middle_m) in middle_m.into_iter().enumerate() {
            point.position_m[axis] = (f64::from(point.position_m[axis]) - middle_m) as f32;
        }
        point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_depends_on_its_blocks_and_those_beside_it() {
        let block = |x: i32, y: i32| Block { level: LevelName::MAIN, x, y };
        for (x, y) in (-9..9).flat_map(|y| (-9..9).map(move |x| (x, y))) {
            let around = Window::around(&block(x, y));
            let all = (-3..3).flat_map(|y| (-3..3).map(move |x| Window { level: LevelName::MAIN, x, y }));
            let dependent: Vec<Window> = all.filter(|window| window.depends_on(&block(x, y))).collect();
            assert_eq!(around, dependent, "{x} {y}");
            let tile = TileKey { level: LevelName::MAIN, x: x.div_euclid(3), y: y.div_euclid(3) };
            assert_eq!(around.iter().filter(|window| window.has(&tile)).count(), 1);
            assert!(around.iter().all(|window| window.tiles().any(|key| key == tile)));
        }
    }
}
