//! Point clouds as PLY.

use std::io::Write;
use viola_formats::ply::{self, Encoding, Ply};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Pose2, Vector3};
use viola_reconstruct::{CloudPoint, Label, PointCloud};

/// Types and names of a vertex's properties.
pub(crate) const PROPERTIES: [(&str, &str); 13] = [
    ("float", "x"),
    ("float", "y"),
    ("float", "z"),
    ("float", "nx"),
    ("float", "ny"),
    ("float", "nz"),
    ("uchar", "red"),
    ("uchar", "green"),
    ("uchar", "blue"),
    ("uchar", "label"),
    ("float", "probability"),
    ("ushort", "views"),
    ("ushort", "weight"),
];
const VERTEX_BYTES: usize = 36;

/// Returns a clip's cloud as binary little-endian PLY: in the map frame if `map_from_clip` is given,
/// otherwise in the clip frame. The header names the frame.
pub fn cloud_ply(cloud_in_clip: &PointCloud, map_from_clip: Option<&Pose2>) -> Vec<u8> {
    let frame = if map_from_clip.is_some() { "map" } else { "clip" };
    let count = cloud_in_clip.points.len();
    let mut out = Vec::with_capacity(400 + count * VERTEX_BYTES);
    let header = ply::header(&[&format!("frame {frame}, metres, z up")], count, &PROPERTIES);
    out.extend_from_slice(header.as_bytes());
    let pose = map_from_clip.copied().unwrap_or(Pose2::IDENTITY);
    for point in &cloud_in_clip.points {
        let (position, normal) = (point.position(), point.normal());
        let at = pose.apply(&position.xy());
        let turned = pose.rotate(&normal.xy());
        let placed = [at.x, at.y, position.z];
        let normal = Vector3::new(turned.x, turned.y, normal.z);
        for value in placed.into_iter().chain(normal.iter().copied()) {
            // Writing into a vector cannot fail.
            let _ = out.write_all(&(value as f32).to_le_bytes());
        }
        out.extend_from_slice(&point.color);
        out.push(point.label.class.id() as u8);
        out.extend_from_slice(&point.label.probability().to_le_bytes());
        out.extend_from_slice(&point.label.views.to_le_bytes());
        out.extend_from_slice(&point.weight.to_le_bytes());
    }
    out
}

/// Error for bytes that [`cloud_ply`] did not write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are not a cloud that this program wrote")]
pub struct NotOurs;

/// Reads the output of [`cloud_ply`]. `voxel_m` is not in the file.
pub fn read_cloud_ply(bytes: &[u8], voxel_m: f64) -> Result<PointCloud, NotOurs> {
    let Ply { elements, numbers } = Ply::parse(bytes).map_err(|_| NotOurs)?;
    let [vertex] = elements.as_slice() else { return Err(NotOurs) };
    if numbers.encoding != Encoding::LittleEndian || !vertex.has_properties(&PROPERTIES) {
        return Err(NotOurs);
    }
    let (count, body) = (usize::try_from(vertex.count).map_err(|_| NotOurs)?, numbers.rest);
    if count.checked_mul(VERTEX_BYTES) != Some(body.len()) {
        return Err(NotOurs);
    }
    let point = |vertex: &[u8]| {
        let float =
            |at: usize| f32::from_le_bytes([vertex[at], vertex[at + 1], vertex[at + 2], vertex[at + 3]]);
        let class = Class::ALL.get(usize::from(vertex[27])).ok_or(NotOurs)?;
        let short = |at: usize| u16::from_le_bytes([vertex[at], vertex[at + 1]]);
        let point = CloudPoint {
            position_m: [float(0), float(4), float(8)],
            normal: [float(12), float(16), float(20)],
            color: [vertex[24], vertex[25], vertex[26]],
            label: Label::new(*class, float(28), short(32)),
            weight: short(34),
        };
        let finite = point.position_m.iter().chain(&point.normal).all(|value| value.is_finite());
        if finite { Ok(point) } else { Err(NotOurs) }
    };
    let points: Result<Vec<CloudPoint>, NotOurs> = body.chunks_exact(VERTEX_BYTES).map(point).collect();
    Ok(PointCloud { points: points?, voxel_m })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> PointCloud {
        let point = |i: u16| CloudPoint {
            position_m: [f32::from(i) * 0.1, -1.5, 0.25],
            normal: [0.0, 0.6, -0.8],
            color: [i as u8, 2, 3],
            label: Label::new(Class::ALL[usize::from(i) % Class::ALL.len()], 0.4, i),
            weight: i,
        };
        PointCloud { points: (0..50).map(point).collect(), voxel_m: 0.03 }
    }

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(read_cloud_ply(&cloud_ply(&cloud(), None), 0.03), Ok(cloud()));
        let empty = PointCloud { points: Vec::new(), voxel_m: 0.03 };
        assert_eq!(read_cloud_ply(&cloud_ply(&empty, Some(&Pose2::IDENTITY)), 0.03), Ok(empty));
    }

    #[test]
    fn other_bytes_are_refused() {
        let good = cloud_ply(&cloud(), None);
        for length in [0, 3, 100, good.len() - 1] {
            assert_eq!(read_cloud_ply(&good[..length], 0.03), Err(NotOurs), "{length}");
        }
        for at in 0..good.len() {
            let mut bytes = good.clone();
            bytes[at] ^= 0xff;
            // Any change must return, with a value or an error.
            let _ = read_cloud_ply(&bytes, 0.03);
        }
        let mut longer = good.clone();
        longer.push(0);
        assert_eq!(read_cloud_ply(&longer, 0.03), Err(NotOurs));
    }
}
