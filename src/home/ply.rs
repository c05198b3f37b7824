//! Point clouds as PLY, which every viewer of the field opens.

use crate::align::PointCloud;
use crate::geometry::{Pose2, Vector3};
use std::io::Write;

/// A binary little-endian PLY of a clip's cloud with normals and colours: in the map frame when the pose is
/// known, in the clip frame otherwise. The header says which.
pub fn cloud_ply(cloud_in_clip: &PointCloud, map_from_clip: Option<&Pose2>) -> Vec<u8> {
    let frame = if map_from_clip.is_some() { "map" } else { "clip" };
    let count = cloud_in_clip.points.len();
    let mut out = Vec::with_capacity(400 + count * 34);
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment frame {frame}, metres, z up\nelement vertex {count}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property uchar label\nproperty float probability\nproperty ushort views\nend_header\n"
    );
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
    }
    out
}
