//! Space that a clip's views looked through: what an earlier clip saw there is gone.

use crate::assemble::sight::{Sight, View};
use crate::ply::UnknownFileFormat;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;
use viola_geometry::{Point3, Pose3, Vector3};
use viola_reconstruct as reconstruct;

/// Voxels of the map along the side of a cell.
pub(crate) const CELL_VOXELS: i32 = 2;
const CELL_M: f64 = crate::MAP_VOXEL_M * CELL_VOXELS as f64;
/// Cells along the side of a block.
pub(crate) const BLOCK_CELLS: i32 = 8;
const BLOCK_M: f64 = CELL_M * BLOCK_CELLS as f64;
/// Bits of a block's cells: a word for each layer, in it a byte for each row.
type Bits = [u64; BLOCK_CELLS as usize];
const BLOCK_BYTES: usize = 3 * 4 + 8 * BLOCK_CELLS as usize;
/// Maximum number of blocks: far above what [`viola_reconstruct`]'s readings can reach in a home.
const MAX_BLOCKS: usize = 1 << 19;
/// Radius around a cell's centre that must have been looked through: half a cell's diagonal.
const RADIUS_M: f64 = CELL_M * 0.866_025_4;
/// A cell is carved if this many views looked through it ...
const MIN_VIEWS: u16 = 2;
/// ... and more than this many times as many as saw a surface there.
const MIN_RATIO: u16 = 3;

/// Set of cells, in blocks. In the clip's frame as stored, in the map's frame as used.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CarvedSpace {
    blocks: FxHashMap<[i32; 3], Bits>,
}

/// Returns the layer and the bit of a cell in its block.
fn bit(cell: [i32; 3]) -> (usize, u64) {
    let [x, y, z] = cell.map(|c| c.rem_euclid(BLOCK_CELLS) as usize);
    (z, 1 << (y * BLOCK_CELLS as usize + x))
}

pub(crate) fn block_of(cell: [i32; 3]) -> [i32; 3] {
    cell.map(|c| c.div_euclid(BLOCK_CELLS))
}

/// Returns the number of a cell in its block.
pub(crate) fn number_of(cell: [i32; 3]) -> usize {
    let (layer, bit) = bit(cell);
    layer * 64 + bit.trailing_zeros() as usize
}

/// Returns the cell of a point.
pub(crate) fn cell_of(position_m: [f64; 3]) -> [i32; 3] {
    position_m.map(|c| (c / CELL_M).floor() as i32)
}

impl CarvedSpace {
    /// Returns the space that the views looked through, in the clip's frame.
    pub fn of(views: &[reconstruct::View]) -> CarvedSpace {
        let views: Vec<View> = views.iter().map(|view| View::new(view, &Pose3::identity())).collect();
        let mut seen_by: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
        let reached: Vec<FxHashSet<[i32; 3]>> = views.par_iter().map(reached).collect();
        for (number, blocks) in (0u32..).zip(reached) {
            for block in blocks {
                if seen_by.len() < MAX_BLOCKS || seen_by.contains_key(&block) {
                    seen_by.entry(block).or_default().push(number);
                }
            }
        }
        let enough = seen_by.into_iter().filter(|(_, by)| by.len() >= usize::from(MIN_VIEWS));
        let blocks: Vec<([i32; 3], Vec<u32>)> = enough.collect();
        let carved = blocks.into_par_iter().map(|(block, by)| {
            let by = by.iter().map(|number| &views[*number as usize]);
            (block, carved_cells(block, by))
        });
        let carved = carved.filter(|(_, bits)| *bits != Bits::default());
        CarvedSpace { blocks: carved.collect::<Vec<_>>().into_iter().collect() }
    }

    /// Removes the cells at these points of the clip's own surface, and the cells around them. Thinned views look past
    /// thin things, which the surface of all readings has; and what another clip saw there is the same surface, since
    /// poses err by centimetres.
    pub(crate) fn keep_off<'a>(&mut self, surface_m: impl Iterator<Item = &'a [f32; 3]>) {
        let cells: FxHashSet<[i32; 3]> = surface_m.map(|at| cell_of(at.map(f64::from))).collect();
        for [x, y, z] in cells {
            let around = (0..27).map(|i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
            for cell in around {
                if let Some(bits) = self.blocks.get_mut(&block_of(cell)) {
                    let (layer, bit) = bit(cell);
                    bits[layer] &= !bit;
                }
            }
        }
        self.blocks.retain(|_, bits| *bits != Bits::default());
    }

    /// Returns whole blocks.
    #[cfg(test)]
    pub(crate) fn of_blocks(blocks: &[[i32; 3]]) -> CarvedSpace {
        CarvedSpace {
            blocks: blocks.iter().map(|block| (*block, [u64::MAX; BLOCK_CELLS as usize])).collect(),
        }
    }

    #[cfg(test)]
    pub(crate) fn contains(&self, position_m: [f64; 3]) -> bool {
        self.contains_cell(cell_of(position_m))
    }

    pub(crate) fn contains_cell(&self, cell: [i32; 3]) -> bool {
        let (layer, bit) = bit(cell);
        self.blocks.get(&block_of(cell)).is_some_and(|bits| bits[layer] & bit != 0)
    }

    /// Calls `each` with the block of each cell, and its number there.
    pub(crate) fn for_each(&self, mut each: impl FnMut([i32; 3], usize)) {
        for (block, bits) in &self.blocks {
            for (layer, word) in bits.iter().enumerate() {
                let mut left = *word;
                while left != 0 {
                    each(*block, layer * 64 + left.trailing_zeros() as usize);
                    left &= left - 1;
                }
            }
        }
    }

    /// Returns the cells of the map whose centres lie in carved cells of the clip, split by `part` of their
    /// blocks. Parts that are none are left out.
    pub(crate) fn placed<K: Ord>(
        &self,
        map_from_clip: &Pose3,
        part: impl Fn([i32; 3]) -> Option<K>,
    ) -> BTreeMap<K, CarvedSpace> {
        let clip_from_map = map_from_clip.inverse();
        let mut placed: FxHashMap<[i32; 3], Bits> = FxHashMap::default();
        for (block, bits) in &self.blocks {
            // The ball around a block covers it at any rotation.
            let corner = Vector3::from(block.map(f64::from)) * BLOCK_M;
            let centre = map_from_clip * Point3::from(corner.add_scalar(BLOCK_M / 2.0));
            let reach = half_extent(&clip_from_map);
            let low = cell_of((centre - reach).coords.into());
            let high = cell_of((centre + reach).coords.into());
            if !blocks_between(block_of(low), block_of(high)).any(|block| part(block).is_some()) {
                continue;
            }
            for (y, z) in (low[2]..=high[2]).flat_map(|z| (low[1]..=high[1]).map(move |y| (y, z))) {
                let row = Row { first: [low[0], y, z], last_x: high[0] };
                for cell in row.carved_cells(*block, bits, &clip_from_map) {
                    let (layer, bit) = bit(cell);
                    placed.entry(block_of(cell)).or_default()[layer] |= bit;
                }
            }
        }
        let mut parts: BTreeMap<K, CarvedSpace> = BTreeMap::new();
        for (block, bits) in placed {
            if let Some(key) = part(block) {
                parts.entry(key).or_default().blocks.insert(block, bits);
            }
        }
        parts
    }

    /// Returns the set as bytes, the same for equal sets; [`CarvedSpace::read`] is the inverse.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut blocks: Vec<(&[i32; 3], &Bits)> = self.blocks.iter().collect();
        blocks.sort_unstable();
        let mut out = Vec::with_capacity(blocks.len() * BLOCK_BYTES);
        for (block, bits) in blocks {
            block.iter().for_each(|c| out.extend_from_slice(&c.to_le_bytes()));
            bits.iter().for_each(|layer| out.extend_from_slice(&layer.to_le_bytes()));
        }
        out
    }

    pub(crate) fn read(bytes: &[u8]) -> Result<CarvedSpace, UnknownFileFormat> {
        let (blocks, rest) = bytes.as_chunks::<BLOCK_BYTES>();
        if !rest.is_empty() || blocks.len() > MAX_BLOCKS {
            return Err(UnknownFileFormat);
        }
        let block = |bytes: &[u8; BLOCK_BYTES]| {
            let (place, layers) = bytes.split_at(12);
            let mut key = [0; 3];
            for (c, four) in key.iter_mut().zip(place.as_chunks::<4>().0) {
                *c = i32::from_le_bytes(*four);
            }
            let mut bits = Bits::default();
            for (layer, eight) in bits.iter_mut().zip(layers.as_chunks::<8>().0) {
                *layer = u64::from_le_bytes(*eight);
            }
            // Far outside of any home; its cells would overflow.
            let is_near = key.iter().all(|c| c.unsigned_abs() < 1 << 20);
            is_near.then_some((key, bits)).ok_or(UnknownFileFormat)
        };
        let blocks: FxHashMap<[i32; 3], Bits> = blocks.iter().map(block).collect::<Result<_, _>>()?;
        Ok(CarvedSpace { blocks })
    }
}

/// Returns the blocks of a box, whose corners are in it.
fn blocks_between(low: [i32; 3], high: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let rows = (low[2]..=high[2]).flat_map(move |z| (low[1]..=high[1]).map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| (low[0]..=high[0]).map(move |x| [x, y, z]))
}

/// A row of cells of the map along x.
struct Row {
    first: [i32; 3],
    last_x: i32,
}

impl Row {
    /// Returns the cells whose centres lie in carved cells of a block of the clip.
    fn carved_cells(
        &self,
        block: [i32; 3],
        bits: &Bits,
        clip_from_map: &Pose3,
    ) -> impl Iterator<Item = [i32; 3]> {
        let Row { first: [first_x, y, z], last_x } = *self;
        let origin = block.map(|b| b * BLOCK_CELLS);
        let step = clip_from_map.rotation * Vector3::x();
        let centre = self.first.map(|c| (f64::from(c) + 0.5) * CELL_M);
        // In units of cells of the clip.
        let mut at = (clip_from_map * Point3::from(centre)).coords / CELL_M;
        (first_x..=last_x).map(move |x| [x, y, z]).filter(move |_| {
            let within = [0, 1, 2].map(|axis| at[axis].floor() as i32 - origin[axis]);
            at += step;
            within.iter().all(|c| (0..BLOCK_CELLS).contains(c)) && {
                let (layer, bit) = bit(within);
                bits[layer] & bit != 0
            }
        })
    }
}

/// Returns half the extent of a block along the map's axes.
fn half_extent(clip_from_map: &Pose3) -> Vector3 {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    Vector3::from(axes.map(|axis| (clip_from_map.rotation * axis).abs().sum() * BLOCK_M / 2.0))
}

/// Returns the blocks that a view's rays cross.
fn reached(view: &View) -> FxHashSet<[i32; 3]> {
    /// Rays are centimetres apart and blocks half a metre wide: a sample of the rays is enough.
    const EVERY: usize = 3;
    let eye = view.eye_m();
    let mut blocks = FxHashSet::default();
    for hit in view.hits_m().step_by(EVERY) {
        let reach = hit - eye;
        let steps = (reach.norm() / (BLOCK_M / 3.0)).ceil().max(1.0);
        for step in 0..=steps as u32 {
            let at = eye + reach * (f64::from(step) / steps);
            blocks.insert([at.x, at.y, at.z].map(|c| (c / BLOCK_M).floor() as i32));
        }
    }
    blocks
}

/// Returns the carved cells of a block, as seen by some of the views.
fn carved_cells<'a>(block: [i32; 3], by: impl Iterator<Item = &'a View<'a>>) -> Bits {
    const CELLS: usize = (BLOCK_CELLS * BLOCK_CELLS * BLOCK_CELLS) as usize;
    let mut counts = [(0u16, 0u16); CELLS];
    for view in by {
        for (number, (surface, through)) in counts.iter_mut().enumerate() {
            match view.own_sight(&centre(block, number as i32), RADIUS_M) {
                Sight::Surface => *surface = surface.saturating_add(1),
                Sight::Through => *through = through.saturating_add(1),
                Sight::Unknown => {}
            }
        }
    }
    let mut bits = Bits::default();
    for (number, (surface, through)) in counts.iter().enumerate() {
        if *through >= MIN_VIEWS && *through > surface.saturating_mul(MIN_RATIO) {
            bits[number / 64] |= 1 << (number % 64);
        }
    }
    bits
}

/// Returns the centre of a block's cell; cells are numbered as their bits.
fn centre(block: [i32; 3], number: i32) -> Point3 {
    let side = BLOCK_CELLS;
    let within = [number % side, number / side % side, number / (side * side)];
    Point3::from([0, 1, 2].map(|axis| (f64::from(block[axis] * side + within[axis]) + 0.5) * CELL_M))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_geometry::Pinhole;
    use viola_reconstruct::Readings;

    /// Returns two views from the clip's origin along its z axis at a wall 3 m away.
    fn views() -> Vec<reconstruct::View> {
        let camera = Pinhole { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };
        let view = |x: f64| reconstruct::View {
            clip_from_camera: Pose3::translation(x, 0.0, 0.0),
            readings: Readings::new(camera, 64, 1, vec![3_000; 64 * 48]).unwrap(),
        };
        vec![view(0.0), view(0.05)]
    }

    #[test]
    fn space_before_a_wall_is_carved_and_the_wall_is_not() {
        let carved = CarvedSpace::of(&views());
        // (place, carved)
        let cases = [
            ([0.0, 0.0, 1.5], true),
            ([0.5, -0.3, 2.0], true),
            ([0.0, 0.0, 2.9], false),
            ([0.0, 0.0, 3.0], false),
            ([0.0, 0.0, 3.4], false),
            // Nearer than any reading counts, behind the camera, and beside the picture.
            ([0.0, 0.0, 0.2], false),
            ([0.0, 0.0, -1.0], false),
            ([1.3, 0.0, 2.0], false),
        ];
        for (place, is_carved) in cases {
            assert_eq!(carved.contains(place), is_carved, "{place:?}");
        }
        assert_eq!(CarvedSpace::of(&views()[..1]), CarvedSpace::default(), "one view is too few");
    }

    /// A floor that is seen at a grazing angle lies just below space that was looked through.
    #[test]
    fn a_floor_stays() {
        let camera = Pinhole { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };
        let height_m = 1.2;
        let depth_mm = (0..48).flat_map(|row| {
            let down = (f64::from(row) + 0.5 - camera.cy) / camera.fy;
            let depth_m = if down > 0.0 { height_m / down } else { 0.0 };
            [if depth_m < 9.0 { (depth_m * 1e3) as u16 } else { 0 }; 64]
        });
        let readings = Readings::new(camera, 64, 1, depth_mm.collect()).unwrap();
        let view = |x: f64| reconstruct::View {
            clip_from_camera: Pose3::translation(x, 0.0, 0.0),
            readings: readings.clone(),
        };
        let carved = CarvedSpace::of(&[view(0.0), view(0.1)]);
        let turned = Pose3::new(Vector3::new(0.4, 0.1, 0.2), Vector3::new(0.0, 0.6, 0.0));
        let all = carved.placed(&turned, |_| Some(())).remove(&()).unwrap();
        let at = |z_m: f64, above_m: f64| {
            let place = turned * Point3::new(0.0, height_m - above_m, z_m);
            all.contains(place.coords.into())
        };
        for z_m in [3.2, 3.6, 4.0, 4.4, 4.8] {
            assert!(!at(z_m, 0.0) && !at(z_m, 0.03), "the floor at {z_m} m");
        }
        assert!(at(3.6, 0.4), "0.4 m above it");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn carved_space_moves_with_its_clip(
            shift in prop::array::uniform3(-5.0..5.0f64), turn in prop::array::uniform3(-3.0..3.0f64),
            along in 0.8..2.2f64, across in -0.1..0.1f64,
        ) {
            let carved = CarvedSpace::of(&views());
            let map_from_clip = Pose3::new(shift.into(), turn.into());
            let placed = carved.placed(&map_from_clip, |block| Some(block[0]));
            let is_carved = |place: [f64; 3]| {
                let at = map_from_clip * Point3::from(place);
                placed.values().any(|part| part.contains(at.coords.into()))
            };
            prop_assert!(is_carved([across, across, along]));
            prop_assert!(!is_carved([across, across, 3.0]));
        }
    }

    #[test]
    fn a_clip_does_not_look_through_its_own_surface() {
        let (whole, mut carved) = (CarvedSpace::of(&views()), CarvedSpace::of(&views()));
        carved.keep_off([[0.0, 0.0, 1.5], [9.0, 0.0, 0.0]].iter());
        // (place, carved): a pole that no view shows, 5 cm beside it, and 20 cm beside it.
        for (place, is_carved) in
            [([0.0, 0.0, 1.5], false), ([0.05, 0.0, 1.5], false), ([0.2, 0.0, 1.5], true)]
        {
            assert!(whole.contains(place) && carved.contains(place) == is_carved, "{place:?}");
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let carved = CarvedSpace::of(&views());
        let bytes = carved.to_bytes();
        assert!(bytes.len() > 1000);
        assert_eq!(CarvedSpace::read(&bytes), Ok(carved));
        assert_eq!(CarvedSpace::read(&[]), Ok(CarvedSpace::default()));
        assert_eq!(CarvedSpace::read(&bytes[1..]), Err(UnknownFileFormat));
        let mut far = bytes;
        far[..4].copy_from_slice(&i32::MAX.to_le_bytes());
        assert_eq!(CarvedSpace::read(&far), Err(UnknownFileFormat));
    }
}
