//! Labelled surfaces for training: the surface that the method fuses from a simulated clip, with the true
//! class of each point.

use crate::simulate::SimulatedClip;
use std::sync::Arc;
use viola_align::{AlignError, AlignParams, observe};
use viola_geometry::Pose3;
use viola_geometry::progress::Progress;

/// Distance within which a fused point belongs to a true surface: noise and drift of the poses.
const REACH_M: f64 = 0.08;

/// Class byte of points without a true surface nearby.
pub const UNKNOWN: u8 = 255;

/// Bytes of a point in [`SurfaceFile`].
pub const RECORD_BYTES: usize = 16;

/// A labelled surface in the clip frame: z up, the floor at z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceFile {
    /// [`RECORD_BYTES`] for each point, little-endian: x, y, z in millimetres (i16), the unit normal in 127ths
    /// (3 x i8), red, green, blue (u8), the class's id or [`UNKNOWN`] (u8), 0 (u8), the instance (u16, 0 for the
    /// building).
    pub bytes: Vec<u8>,
}

/// Fuses a recording and labels its points by the truth. None if the method found no floor.
pub fn labelled_surface(
    recorded: SimulatedClip,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Option<SurfaceFile>, AlignError> {
    let recorded = Arc::new(recorded);
    let clip = crate::simulate::clip_in_memory(recorded.clone());
    let observation = observe(&clip, None, params, progress)?;
    let Some(clip_from_world) = observation.clip_from_world else { return Ok(None) };
    let home_from_clip: Pose3 = (clip_from_world * recorded.truth.world_from_home).inverse();
    let mut bytes = Vec::with_capacity(observation.cloud_in_clip.points.len() * RECORD_BYTES);
    for point in &observation.cloud_in_clip.points {
        let at = home_from_clip * point.position();
        let normal = home_from_clip * point.normal();
        let (class, instance) = recorded
            .label_at(&at, &normal, REACH_M)
            .map_or((UNKNOWN, 0), |(class, instance)| (class.id() as u8, instance));
        for metres in point.position_m {
            bytes.extend_from_slice(&((metres * 1000.0).round() as i16).to_le_bytes());
        }
        bytes.extend(point.normal.map(|part| (part * 127.0).round() as i8 as u8));
        bytes.extend(point.color);
        bytes.extend([class, 0]);
        bytes.extend_from_slice(&instance.to_le_bytes());
    }
    Ok(Some(SurfaceFile { bytes }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{ClipParams, Home, HomeParams, Set};
    use viola_geometry::progress::Silent;
    use viola_geometry::taxonomy::Class;

    #[test]
    fn level_points_at_the_floor_are_floor() {
        let home = Home::generate(&HomeParams::new(Set::Normal, 3));
        let clip = home.clip(&home.survey(), 0, &ClipParams { frames: 8, ..ClipParams::default() });
        let surface = labelled_surface(clip, &AlignParams::default(), &Silent).unwrap().unwrap();
        let records = || surface.bytes.chunks_exact(RECORD_BYTES);
        let height_mm = |record: &[u8]| i16::from_le_bytes([record[4], record[5]]);
        let low = || records().filter(|r| height_mm(r).abs() < 25 && r[8] as i8 > 115);
        let floor = low().filter(|r| r[12] == Class::Floor as u8 || r[12] == Class::Rug as u8).count();
        assert!(low().count() > 500 && floor * 20 > low().count() * 19, "{floor} of {}", low().count());
        let unknown = records().filter(|r| r[12] == UNKNOWN).count();
        assert!(unknown * 20 < records().count(), "{unknown} of {}", records().count());
    }
}
