//! Point clouds as PLY.

use viola_formats::ply::{self, Encoding, Ply};
use viola_geometry::Pose2;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::{CloudPoint, Label, OTHER_CLASSES, PointCloud};

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
/// Bytes of the properties before the weight: a map's files have the clip's number between them.
pub(crate) const HEAD_BYTES: usize = 34;
/// Bytes of a vertex with [`PROPERTIES`].
const POINT_BYTES: usize = HEAD_BYTES + 2;
/// Further properties of a clip's cloud: the next classes, with probabilities in 255ths. Files of the previous
/// version have none.
const OTHERS: [(&str, &str); 2 * OTHER_CLASSES] = [
    ("uchar", "label_2"),
    ("uchar", "share_2"),
    ("uchar", "label_3"),
    ("uchar", "share_3"),
    ("uchar", "label_4"),
    ("uchar", "share_4"),
];
const VERTEX_BYTES: usize = POINT_BYTES + OTHERS.len();

/// Returns a clip's cloud as binary little-endian PLY: in the map frame if `map_from_clip` is given,
/// otherwise in the clip frame. The header names the frame.
pub fn cloud_ply(cloud_in_clip: &PointCloud, map_from_clip: Option<&Pose2>) -> Vec<u8> {
    let frame = if map_from_clip.is_some() { "map" } else { "clip" };
    let count = cloud_in_clip.points.len();
    let mut out = Vec::with_capacity(500 + count * VERTEX_BYTES);
    let properties = [&PROPERTIES[..], &OTHERS].concat();
    let header = ply::header(&[&format!("frame {frame}, metres, z up")], count, &properties);
    out.extend_from_slice(header.as_bytes());
    let pose = map_from_clip.copied().unwrap_or(Pose2::IDENTITY);
    for point in &cloud_in_clip.points {
        let (position, normal) = (point.position(), point.normal());
        let at = pose.apply(&position.xy());
        let turned = pose.rotate(&normal.xy());
        let position_m = [at.x, at.y, position.z].map(|c| c as f32);
        let normal = [turned.x, turned.y, normal.z].map(|c| c as f32);
        out.extend_from_slice(&head_bytes(&CloudPoint { position_m, normal, ..*point }));
        out.extend_from_slice(&point.weight.to_le_bytes());
        for (class, fraction) in point.label.others() {
            out.extend_from_slice(&[class.id() as u8, fraction]);
        }
    }
    out
}

/// Returns the properties of a point before its weight.
pub(crate) fn head_bytes(point: &CloudPoint) -> [u8; HEAD_BYTES] {
    let mut bytes = [0; HEAD_BYTES];
    let numbers = point.position_m.iter().chain(&point.normal);
    bytes.as_chunks_mut::<4>().0.iter_mut().zip(numbers).for_each(|(four, c)| *four = c.to_le_bytes());
    bytes[24..27].copy_from_slice(&point.color);
    bytes[27] = point.label.class.id() as u8;
    bytes[28..32].copy_from_slice(&point.label.probability().to_le_bytes());
    bytes[32..].copy_from_slice(&point.label.views.to_le_bytes());
    bytes
}

/// Inverse of [`head_bytes`]; the weight comes after these bytes.
pub(crate) fn read_head(bytes: &[u8; HEAD_BYTES], weight: u16) -> Result<CloudPoint, UnknownFileFormat> {
    let float = |place: usize| f32::from_le_bytes(bytes.as_chunks::<4>().0[place]);
    let class = class_of(bytes[27])?;
    let point = CloudPoint {
        position_m: [float(0), float(1), float(2)],
        normal: [float(3), float(4), float(5)],
        color: [bytes[24], bytes[25], bytes[26]],
        label: Label::new(class, float(7), u16::from_le_bytes([bytes[32], bytes[33]])),
        weight,
    };
    let is_finite = point.position_m.iter().chain(&point.normal).all(|value| value.is_finite());
    is_finite.then_some(point).ok_or(UnknownFileFormat)
}

pub(crate) fn class_of(id: u8) -> Result<Class, UnknownFileFormat> {
    Class::from_id(usize::from(id)).ok_or(UnknownFileFormat)
}

/// Error for bytes that [`cloud_ply`] did not write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are not a cloud that this program wrote")]
pub struct UnknownFileFormat;

/// Reads the output of [`cloud_ply`]. `voxel_m` is not in the file.
pub fn read_cloud_ply(bytes: &[u8], voxel_m: f64) -> Result<PointCloud, UnknownFileFormat> {
    let Ply { elements, numbers } = Ply::parse(bytes).map_err(|_| UnknownFileFormat)?;
    let [vertex] = elements.as_slice() else { return Err(UnknownFileFormat) };
    let vertex_bytes = if vertex.has_properties(&[&PROPERTIES[..], &OTHERS].concat()) {
        VERTEX_BYTES
    } else if vertex.has_properties(&PROPERTIES) {
        POINT_BYTES
    } else {
        return Err(UnknownFileFormat);
    };
    let (count, body) = (usize::try_from(vertex.count).map_err(|_| UnknownFileFormat)?, numbers.rest);
    if numbers.encoding != Encoding::LittleEndian || count.checked_mul(vertex_bytes) != Some(body.len()) {
        return Err(UnknownFileFormat);
    }
    let point = |vertex: &[u8]| -> Result<CloudPoint, UnknownFileFormat> {
        let (head, rest) = vertex.split_first_chunk().ok_or(UnknownFileFormat)?;
        let (weight, fractions) = rest.split_first_chunk().ok_or(UnknownFileFormat)?;
        let mut point = read_head(head, u16::from_le_bytes(*weight))?;
        let mut others = [(Class::Other, 0); OTHER_CLASSES];
        for (place, [class, fraction]) in others.iter_mut().zip(fractions.as_chunks::<2>().0) {
            *place = (class_of(*class)?, *fraction);
        }
        point.label = point.label.with_fractions(others);
        Ok(point)
    };
    let points: Result<Vec<CloudPoint>, UnknownFileFormat> =
        body.chunks_exact(vertex_bytes).map(point).collect();
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
            label: Label::new(Class::ALL[usize::from(i) % Class::ALL.len()], 0.4, i)
                .with_others([(Class::Bed, 0.3), (Class::Sofa, 0.1)].into_iter().take(usize::from(i) % 3)),
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
    fn files_of_the_previous_version_are_read() {
        let now = cloud_ply(&cloud(), None);
        let body = now.len() - cloud().points.len() * VERTEX_BYTES;
        let head = ply::header(&["frame clip, metres, z up"], cloud().points.len(), &PROPERTIES);
        let points = now[body..].chunks_exact(VERTEX_BYTES).flat_map(|vertex| &vertex[..POINT_BYTES]);
        let before: Vec<u8> = head.as_bytes().iter().chain(points).copied().collect();
        let mut want = cloud();
        want.points.iter_mut().for_each(|point| point.label = point.label.with_others([]));
        assert_eq!(read_cloud_ply(&before, 0.03), Ok(want));
    }

    #[test]
    fn other_bytes_are_refused() {
        let good = cloud_ply(&cloud(), None);
        for length in [0, 3, 100, good.len() - 1] {
            assert_eq!(read_cloud_ply(&good[..length], 0.03), Err(UnknownFileFormat), "{length}");
        }
        for at in 0..good.len() {
            let mut bytes = good.clone();
            bytes[at] ^= 0xff;
            // Any change must return, with a value or an error.
            let _ = read_cloud_ply(&bytes, 0.03);
        }
        let mut longer = good.clone();
        longer.push(0);
        assert_eq!(read_cloud_ply(&longer, 0.03), Err(UnknownFileFormat));
    }
}
