//! Labelled surfaces for training: the surface that the method fuses from a simulated clip, with the true
//! class of each point.

use crate::simulate::{HomeObject, SimulatedClip};
use std::sync::Arc;
use viola_align::{AlignError, AlignParams, observe};
use viola_geometry::progress::Progress;
use viola_geometry::{Point3, Pose3, Vector3};

/// Distance within which a fused point belongs to a true surface: noise and drift of the poses.
pub const REACH_M: f64 = 0.08;

/// Class byte of points without a true surface nearby.
const UNKNOWN: u8 = 255;

/// Bytes of a point.
const RECORD_BYTES: usize = 16;

/// Fuses a recording and labels its points by the truth. Returns the file of the surface in the clip frame, z up and the
/// floor at z = 0; none if the method found no floor.
///
/// Little-endian. The number of points (u32), 16 bytes for each point, then the objects.
///
/// A point: x, y, z in millimetres (i16), the unit normal in 127ths (3 x i8), red, green, blue (u8), the class's id or 255
/// (u8), 0 (u8), the number of the object that gave it its class (u16, 0 for none). An object, the first is number 1: the
/// centre of its box and its size in metres, its yaw in radians (7 x f32).
pub fn labelled_surface(
    recorded: SimulatedClip,
    objects: &[HomeObject],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Option<Vec<u8>>, AlignError> {
    let recorded = Arc::new(recorded);
    let clip = crate::simulate::clip_in_memory(recorded.clone());
    let observation = observe(&clip, None, params, progress)?;
    let Some(clip_from_world) = observation.clip_from_world else { return Ok(None) };
    let clip_from_home: Pose3 = clip_from_world * recorded.truth.world_from_home;
    let home_from_clip = clip_from_home.inverse();
    let points = &observation.cloud_in_clip.points;
    let mut bytes = (points.len() as u32).to_le_bytes().to_vec();
    bytes.reserve(points.len() * RECORD_BYTES);
    for point in points {
        let at = home_from_clip * point.position();
        let normal = home_from_clip * point.normal();
        let (class, instance) = match recorded.label_at(&at, &normal, REACH_M) {
            None => (UNKNOWN, 0),
            Some((class, instance)) => {
                let object = usize::from(instance).checked_sub(1).and_then(|index| objects.get(index));
                (class.id() as u8, if object.is_some_and(|o| o.class == class) { instance } else { 0 })
            }
        };
        for metres in point.position_m {
            bytes.extend_from_slice(&((metres * 1000.0).round() as i16).to_le_bytes());
        }
        bytes.extend(point.normal.map(|part| (part * 127.0).round() as i8 as u8));
        bytes.extend(point.color);
        bytes.extend([class, 0]);
        bytes.extend_from_slice(&instance.to_le_bytes());
    }
    let ahead = clip_from_home * Vector3::x();
    for object in objects {
        let centre = clip_from_home * Point3::from(object.centre_m);
        let yaw_rad = object.yaw_rad + ahead.y.atan2(ahead.x);
        for value in centre.iter().chain(&object.size_m).chain([&yaw_rad]) {
            bytes.extend_from_slice(&(*value as f32).to_le_bytes());
        }
    }
    Ok(Some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{ClipParams, Home, HomeParams, Set};
    use viola_geometry::progress::Silent;
    use viola_geometry::taxonomy::Class;

    /// A record as numbers.
    struct Record {
        position_m: [f32; 3],
        up: i8,
        class: u8,
        instance: usize,
    }

    /// Returns the points of a short clip, and the seven numbers of each object.
    fn read(seed: u64) -> (Vec<Record>, Vec<[f32; 7]>) {
        let home = Home::generate(&HomeParams::new(Set::Normal, seed));
        let clip = home.clip(&home.survey(), 0, &ClipParams { frames: 8, ..ClipParams::default() });
        let objects = home.objects_alone();
        let surface = labelled_surface(clip, &objects, &AlignParams::default(), &Silent).unwrap().unwrap();
        let points = u32::from_le_bytes(surface[..4].try_into().unwrap()) as usize;
        let (records, boxes) = surface[4..].split_at(points * RECORD_BYTES);
        assert_eq!(boxes.len(), objects.len() * 28);
        let record = |bytes: &[u8]| Record {
            position_m: [0, 2, 4].map(|k| f32::from(i16::from_le_bytes([bytes[k], bytes[k + 1]])) / 1000.0),
            up: bytes[8] as i8,
            class: bytes[12],
            instance: usize::from(u16::from_le_bytes([bytes[14], bytes[15]])),
        };
        let number = |bytes: &[u8], k: usize| f32::from_le_bytes(bytes[4 * k..][..4].try_into().unwrap());
        let numbers = |bytes: &[u8]| std::array::from_fn(|k| number(bytes, k));
        (
            records.chunks_exact(RECORD_BYTES).map(record).collect(),
            boxes.chunks_exact(28).map(numbers).collect(),
        )
    }

    #[test]
    fn level_points_at_the_floor_are_floor() {
        let (records, _) = read(6);
        let low = || records.iter().filter(|r| r.position_m[2].abs() < 0.025 && r.up > 115);
        let floor = low().filter(|r| r.class == Class::Floor as u8 || r.class == Class::Rug as u8).count();
        assert!(low().count() > 500 && floor * 20 > low().count() * 19, "{floor} of {}", low().count());
        let unknown = records.iter().filter(|r| r.class == UNKNOWN).count();
        assert!(unknown * 20 < records.len(), "{unknown} of {}", records.len());
    }

    /// Points of an object are in its box.
    #[test]
    fn objects_are_where_their_points_are() {
        let (records, boxes) = read(4);
        let (mut inside, mut all) = (0, 0);
        for Record { position_m: [x, y, z], instance, .. } in records {
            let Some(object) = instance.checked_sub(1) else { continue };
            let [cx, cy, cz, width, depth, height, yaw] = boxes[object];
            let (sin, cos) = yaw.sin_cos();
            let own = [cos * (x - cx) + sin * (y - cy), cos * (y - cy) - sin * (x - cx), z - cz];
            let is_inside =
                own.iter().zip([width, depth, height]).all(|(v, size)| v.abs() < size / 2.0 + 0.1);
            (inside, all) = (inside + usize::from(is_inside), all + 1);
        }
        assert!(all > 500 && inside * 50 > all * 49, "{inside} of {all}");
    }
}
