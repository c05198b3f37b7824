//! Clips that looked through the space of changed tiles: whether a place was empty before an object was seen
//! there, and whether it is empty since.

use super::members::PlacedClip;
use super::tile::TileKey;
use super::varint::{Reader, put, put_place};
use crate::carved::{BLOCK_CELLS, CarvedSpace, block_of, cell_of, number_of};
use crate::ply::UnknownFileFormat;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;
use viola_geometry::LevelName;

const CELLS: usize = (BLOCK_CELLS * BLOCK_CELLS * BLOCK_CELLS) as usize;
/// The value of a cell that no clip looked through.
const NEVER: u16 = u16::MAX;

/// The first and the last clip that looked through each cell of a block, by their numbers in the map.
type Block = Box<[[u16; 2]; CELLS]>;

/// Clips that looked through the cells of the changed tiles of one level. Clips of unknown time are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct LookedThrough {
    level: LevelName,
    blocks: FxHashMap<[i32; 3], Block>,
    tiles: BTreeSet<TileKey>,
    /// Recording times of the map's clips.
    times_ms: Vec<Option<i64>>,
}

impl LookedThrough {
    /// Returns that of no tiles of a level. The times are those of `clips`, which are the clips of the map.
    pub fn of(level: LevelName, clips: &[PlacedClip]) -> LookedThrough {
        LookedThrough {
            level,
            blocks: FxHashMap::default(),
            tiles: BTreeSet::new(),
            times_ms: clips.iter().map(|clip| clip.recorded_at_ms).collect(),
        }
    }

    /// Adds a tile of the level with its cells.
    pub(super) fn add(&mut self, tile: TileKey, of_tile: LookedCells) {
        self.tiles.insert(tile);
        self.blocks.extend(of_tile.blocks);
    }

    /// Returns the time of recording of a clip of the map.
    pub fn time_ms(&self, clip: u16) -> Option<i64> {
        self.times_ms.get(usize::from(clip)).copied().flatten()
    }

    /// Returns whether a clip from before `time_ms` looked through a place; none in tiles that did not change.
    pub fn before(&self, at_m: [f32; 3], time_ms: i64) -> Option<bool> {
        let [first, _] = self.at(at_m)?;
        Some(self.time_ms(first).is_some_and(|looked_ms| looked_ms < time_ms))
    }

    /// Returns whether a clip from after `time_ms` looked through a place; none in tiles that did not change.
    pub fn after(&self, at_m: [f32; 3], time_ms: i64) -> Option<bool> {
        let [_, last] = self.at(at_m)?;
        Some(self.time_ms(last).is_some_and(|looked_ms| looked_ms > time_ms))
    }

    /// Returns that of no tiles.
    #[cfg(test)]
    pub(crate) fn of_times(times_ms: &[Option<i64>]) -> LookedThrough {
        LookedThrough { times_ms: times_ms.to_vec(), ..LookedThrough::of(LevelName::MAIN, &[]) }
    }

    /// Returns that of the tiles around the origin; `empty` names what a clip looked through.
    #[cfg(test)]
    pub(crate) fn of_boxes(times_ms: &[Option<i64>], empty: &[([f64; 3], [f64; 3], u16)]) -> LookedThrough {
        let tiles = (-2..2).flat_map(|x| (-2..2).map(move |y| TileKey { level: LevelName::MAIN, x, y }));
        let mut looked = LookedThrough { tiles: tiles.collect(), ..LookedThrough::of_times(times_ms) };
        for (low_m, high_m, clip) in empty {
            let (low, high) = (cell_of(*low_m), cell_of(*high_m));
            for (z, y, x) in (low[2]..=high[2]).flat_map(|z| {
                (low[1]..=high[1]).flat_map(move |y| (low[0]..=high[0]).map(move |x| (z, y, x)))
            }) {
                let block = looked.blocks.entry(block_of([x, y, z]));
                let [first, last] =
                    &mut block.or_insert_with(|| Box::new([[NEVER; 2]; CELLS]))[number_of([x, y, z])];
                *first = (*first).min(*clip);
                *last = if *last == NEVER { *clip } else { (*last).max(*clip) };
            }
        }
        looked
    }

    /// Returns whether the tile at a place was rebuilt.
    pub fn is_remade(&self, [x_m, y_m]: [f64; 2]) -> bool {
        self.tiles.contains(&TileKey::at(self.level, x_m, y_m))
    }

    /// Returns whether a clip of the map was recorded at `time_ms`.
    pub fn has_clip_of(&self, time_ms: i64) -> bool {
        self.times_ms.contains(&Some(time_ms))
    }

    fn at(&self, at_m: [f32; 3]) -> Option<[u16; 2]> {
        let at_m = at_m.map(f64::from);
        if !self.is_remade([at_m[0], at_m[1]]) {
            return None;
        }
        let cell = cell_of(at_m);
        let block = self.blocks.get(&block_of(cell));
        Some(block.map_or([NEVER; 2], |cells| cells[number_of(cell)]))
    }
}

/// The cells of one tile, to which clips are added in the map's order.
#[derive(Debug, Default, PartialEq)]
pub(super) struct LookedCells {
    blocks: FxHashMap<[i32; 3], Block>,
}

impl LookedCells {
    pub fn add(&mut self, carved: &CarvedSpace, clip: u16) {
        carved.for_each(|block, number| {
            let cells = self.blocks.entry(block).or_insert_with(|| Box::new([[NEVER; 2]; CELLS]));
            let [first, last] = &mut cells[number];
            if *first == NEVER {
                *first = clip;
            }
            *last = clip;
        });
    }

    #[cfg(test)]
    pub fn at(&self, cell: [i32; 3]) -> [u16; 2] {
        self.blocks.get(&block_of(cell)).map_or([NEVER; 2], |cells| cells[number_of(cell)])
    }

    /// Returns the cells with other numbers of the clips.
    pub fn renumbered(mut self, numbers: &[u16]) -> LookedCells {
        for clip in self.blocks.values_mut().flat_map(|block| block.as_flattened_mut()) {
            *clip = numbers.get(usize::from(*clip)).copied().unwrap_or(NEVER);
        }
        self
    }

    /// Appends the cells: for each block runs of cells with the same clips. [`LookedCells::read`] is the inverse.
    pub fn write(&self, out: &mut Vec<u8>) {
        let mut blocks: Vec<(&[i32; 3], &Block)> = self.blocks.iter().collect();
        blocks.sort_unstable_by_key(|(key, _)| **key);
        put(out, blocks.len() as u64);
        for (key, cells) in blocks {
            put_place(out, *key);
            for run in cells.chunk_by(|a, b| a == b) {
                put(out, run.len() as u64);
                run[0].iter().for_each(|clip| put(out, u64::from(clip.wrapping_add(1))));
            }
        }
    }

    pub fn read(reader: &mut Reader) -> Result<LookedCells, UnknownFileFormat> {
        let mut looked = LookedCells::default();
        for _ in 0..reader.count()? {
            let key = reader.place()?;
            let mut cells = Box::new([[NEVER; 2]; CELLS]);
            let mut left = &mut cells[..];
            while !left.is_empty() {
                let length = usize::try_from(reader.number()?).map_err(|_| UnknownFileFormat)?;
                let (run, rest) = left.split_at_mut_checked(length.max(1)).ok_or(UnknownFileFormat)?;
                let [first, last] = [reader.narrow::<u16>()?, reader.narrow::<u16>()?];
                run.fill([first.wrapping_sub(1), last.wrapping_sub(1)]);
                left = rest;
            }
            looked.blocks.insert(key, cells);
        }
        Ok(looked)
    }
}
