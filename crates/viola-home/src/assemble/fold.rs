//! A tile under construction, to which clips are added in the map's order, and its file.
//!
//! The sums of the first clips are kept with the map, so a clip that comes last is added to them without a look at
//! the others. They are whole numbers: sums that were kept are the same as sums that are made again.

use super::floor_correction::FloorCorrection;
use super::looked::LookedCells;
use super::members::PlacedClip;
use super::tile::Tile;
use super::varint::{Reader, put};
use super::voxels::Voxels;
use crate::MAP_VOXEL_M;
use crate::carved::{CELL_VOXELS, CarvedSpace};
use crate::ply::UnknownFileFormat;
use flate2::Crc;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use uuid::Uuid;
use viola_geometry::Pose2;
use viola_reconstruct::CloudPoint;

/// Points and carved space of a clip in one tile, in the map's frame.
#[derive(Default)]
pub(super) struct Part {
    pub points: Vec<CloudPoint>,
    /// Empty if the time of recording is not known.
    pub carved: CarvedSpace,
}

/// A clip as it is part of a tile.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Source {
    #[serde(rename = "share")]
    contribution: String,
    map_from_clip: Pose2,
    #[serde(rename = "level")]
    floor_correction: FloorCorrection,
    recorded_at_ms: Option<i64>,
}

impl Source {
    fn of(clip: &PlacedClip) -> Source {
        Source {
            contribution: clip.contribution.clone(),
            map_from_clip: clip.map_from_clip,
            floor_correction: clip.floor_correction,
            recorded_at_ms: clip.recorded_at_ms,
        }
    }
}

/// A tile with its first clips. Clips are named by their places among those of the tile.
pub(super) struct Fold {
    sources: Vec<Source>,
    /// Points of clips without a time.
    timeless: Voxels,
    /// Points of the clips before `time_ms`, without what later clips looked through.
    earlier: Voxels,
    /// Points of the clips of `time_ms`.
    now: Voxels,
    time_ms: Option<i64>,
    looked: LookedCells,
}

const MAGIC: &[u8; 8] = b"violas02";
/// Bytes of the checksum at the end of a file: damaged sums would be passed on from merge to merge.
const CHECKSUM_BYTES: usize = 4;

impl Fold {
    pub fn new() -> Fold {
        let voxels = || Voxels::new(MAP_VOXEL_M);
        Fold {
            sources: Vec::new(),
            timeless: voxels(),
            earlier: voxels(),
            now: voxels(),
            time_ms: None,
            looked: LookedCells::default(),
        }
    }

    /// Returns the number of clips in it.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// Adds the next clip. Points of earlier clips in space that it looked through are removed: the world changed there.
    /// Clips without a time lose no points.
    pub fn add(&mut self, part: &Part, clip: &PlacedClip) {
        let number = self.sources.len() as u16;
        self.sources.push(Source::of(clip));
        let voxels = if clip.recorded_at_ms.is_none() {
            &mut self.timeless
        } else {
            if clip.recorded_at_ms != self.time_ms {
                self.earlier.merge(&std::mem::replace(&mut self.now, Voxels::new(MAP_VOXEL_M)));
                self.time_ms = clip.recorded_at_ms;
            }
            let is_gone =
                |voxel: &[i32; 3]| part.carved.contains_cell(voxel.map(|c| c.div_euclid(CELL_VOXELS)));
            self.earlier.clear(is_gone);
            &mut self.now
        };
        part.points.iter().for_each(|point| voxels.add(point, number));
        self.looked.add(&part.carved, number);
    }

    /// Returns the tile with its own clip numbers, none without points, and its cells that were looked through by the
    /// numbers of the map. `clips` are those of the tile, with their numbers in the map.
    pub fn finish(self, clips: &[(usize, &PlacedClip)]) -> (Option<Tile>, LookedCells) {
        let mut voxels = self.earlier;
        voxels.merge(&self.now);
        voxels.merge(&self.timeless);
        let mut points = voxels.into_points();
        let numbers: BTreeSet<u16> = points.iter().map(|point| point.clip).collect();
        let numbers: Vec<u16> = numbers.into_iter().collect();
        for point in &mut points {
            point.clip = numbers.binary_search(&point.clip).unwrap_or_default() as u16;
        }
        let ids: Vec<Uuid> = numbers.iter().map(|number| clips[usize::from(*number)].1.clip).collect();
        let of_clips = points.iter().map(|point| point.point.label).collect();
        let tile = (!points.is_empty()).then_some(Tile { clips: ids, points, of_clips });
        let in_map: Vec<u16> = clips.iter().map(|(number, _)| *number as u16).collect();
        (tile, self.looked.renumbered(&in_map))
    }

    pub fn to_bytes(&self) -> Vec<u8> {
        let sources = serde_json::to_vec(&self.sources).unwrap_or_default();
        let mut out = MAGIC.to_vec();
        put(&mut out, sources.len() as u64);
        out.extend_from_slice(&sources);
        [&self.timeless, &self.earlier, &self.now].iter().for_each(|voxels| voxels.write(&mut out));
        self.looked.write(&mut out);
        out.extend_from_slice(&checksum(&out));
        out
    }

    /// Inverse of [`Fold::to_bytes`]; fails unless its clips are the first of `clips`.
    pub fn read(bytes: &[u8], clips: &[(usize, &PlacedClip)]) -> Result<Fold, UnknownFileFormat> {
        let (bytes, sum) = bytes.split_last_chunk::<CHECKSUM_BYTES>().ok_or(UnknownFileFormat)?;
        if checksum(bytes) != *sum {
            return Err(UnknownFileFormat);
        }
        let mut reader = Reader(bytes);
        if reader.bytes(MAGIC.len())? != MAGIC {
            return Err(UnknownFileFormat);
        }
        let length = reader.count()?;
        let sources: Vec<Source> =
            serde_json::from_slice(reader.bytes(length)?).map_err(|_| UnknownFileFormat)?;
        let now = clips.iter().map(|(_, clip)| Source::of(clip));
        if sources.len() > clips.len() || !sources.iter().zip(now).all(|(then, now)| *then == now) {
            return Err(UnknownFileFormat);
        }
        let [timeless, earlier, now] = [(); 3].map(|()| Voxels::read(&mut reader, sources.len()));
        let time_ms = sources.last().and_then(|source| source.recorded_at_ms);
        let looked = LookedCells::read(&mut reader)?;
        if !reader.0.is_empty() {
            return Err(UnknownFileFormat);
        }
        Ok(Fold { sources, timeless: timeless?, earlier: earlier?, now: now?, time_ms, looked })
    }
}

/// Returns the CRC-32.
fn checksum(bytes: &[u8]) -> [u8; CHECKSUM_BYTES] {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum().to_le_bytes()
}

#[cfg(test)]
mod tests;
