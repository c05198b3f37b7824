//! A map's points as E57 (ASTM E2807): one point cloud with colours, normals and classes.

use crate::MapPoint;
use e57::{E57Writer, Extension, Record, RecordDataType, RecordName, RecordValue};
use std::io::{self, Read, Seek, Write};
use uuid::Uuid;
use viola_geometry::taxonomy::CLASSES;

/// The extension of E57 for normals (libe57.org).
const NORMALS: (&str, &str) = ("nor", "http://www.libe57.org/E57_NOR_surface_normals.txt");
/// Our own extension: `class`, `probability` and `clip`.
const OWN: (&str, &str) = ("viola", "urn:viola:e57:1");

/// Writes points as E57 to an empty file. `id` is the file's id.
pub fn write_e57<W: Read + Write + Seek>(
    out: W,
    id: Uuid,
    points: impl IntoIterator<Item = io::Result<MapPoint>>,
) -> io::Result<()> {
    let guid = format!("{{{id}}}");
    let mut file = E57Writer::new(out, &guid).map_err(io::Error::other)?;
    for (namespace, url) in [NORMALS, OWN] {
        file.register_extension(Extension::new(namespace, url)).map_err(io::Error::other)?;
    }
    // The cloud has an id of its own, which depends on nothing else.
    let cloud_guid = format!("{{{}}}", Uuid::from_u128(id.as_u128() ^ 1));
    let mut cloud = file.add_pointcloud(&cloud_guid, prototype()).map_err(io::Error::other)?;
    cloud.set_name(Some("map".to_owned()));
    cloud.set_description(Some(description()));
    for point in points {
        cloud.add_point(values(&point?)).map_err(io::Error::other)?;
    }
    cloud.finalize().map_err(io::Error::other)?;
    file.finalize().map_err(io::Error::other)
}

/// Returns the frame and the classes, for people who open the file.
fn description() -> String {
    format!("frame of the LiDAR map, metres, z up; viola:class: {}", super::class_list())
}

fn prototype() -> Vec<Record> {
    let meters = RecordDataType::Single { min: None, max: None };
    let channel = RecordDataType::Integer { min: 0, max: 255 };
    let component = RecordDataType::Single { min: Some(-1.0), max: Some(1.0) };
    let extra = |(namespace, _): (&str, &str), name: &str| RecordName::Unknown {
        namespace: namespace.to_owned(),
        name: name.to_owned(),
    };
    let record = |name, data_type: &RecordDataType| Record { name, data_type: data_type.clone() };
    vec![
        record(RecordName::CartesianX, &meters),
        record(RecordName::CartesianY, &meters),
        record(RecordName::CartesianZ, &meters),
        record(RecordName::ColorRed, &channel),
        record(RecordName::ColorGreen, &channel),
        record(RecordName::ColorBlue, &channel),
        record(extra(NORMALS, "normalX"), &component),
        record(extra(NORMALS, "normalY"), &component),
        record(extra(NORMALS, "normalZ"), &component),
        record(extra(OWN, "class"), &RecordDataType::Integer { min: 0, max: CLASSES as i64 - 1 }),
        record(extra(OWN, "probability"), &RecordDataType::Single { min: Some(0.0), max: Some(1.0) }),
        record(extra(OWN, "clip"), &RecordDataType::Integer { min: 0, max: i64::from(u16::MAX) }),
    ]
}

/// Returns a point's values in the order of [`prototype`].
fn values(MapPoint { point, clip }: &MapPoint) -> Vec<RecordValue> {
    let mut values = Vec::with_capacity(12);
    values.extend(point.position_m.map(RecordValue::Single));
    values.extend(point.color.map(|channel| RecordValue::Integer(i64::from(channel))));
    values.extend(point.normal.map(|component| RecordValue::Single(component.clamp(-1.0, 1.0))));
    values.push(RecordValue::Integer(i64::from(point.label.class.id())));
    values.push(RecordValue::Single(point.label.probability().clamp(0.0, 1.0)));
    values.push(RecordValue::Integer(i64::from(*clip)));
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::tests::{Full, points};
    use e57::E57Reader;
    use std::io::Cursor;

    fn e57(points: &[MapPoint]) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        write_e57(&mut out, Uuid::from_u128(5), points.iter().copied().map(Ok)).unwrap();
        out.into_inner()
    }

    #[test]
    fn points_are_read_back_bit_for_bit() {
        let points = points(5000);
        let mut reader = E57Reader::new(Cursor::new(e57(&points))).unwrap();
        assert_eq!(reader.guid(), "{00000000-0000-0000-0000-000000000005}");
        let clouds = reader.pointclouds();
        let [cloud] = clouds.as_slice() else { panic!("{} clouds", clouds.len()) };
        assert_eq!(cloud.records, 5000);
        let bounds = cloud.cartesian_bounds.as_ref().unwrap();
        assert_eq!((bounds.x_min, bounds.y_min), (Some(0.0), Some(-1.5)));
        let read: Vec<Vec<RecordValue>> =
            reader.pointcloud_raw(cloud).unwrap().collect::<Result<_, _>>().unwrap();
        assert_eq!(read, points.iter().map(values).collect::<Vec<_>>());
    }

    #[test]
    fn a_map_without_points_is_a_file_without_points() {
        let reader = E57Reader::new(Cursor::new(e57(&[]))).unwrap();
        assert_eq!(reader.pointclouds()[0].records, 0);
    }

    #[test]
    fn a_full_disk_is_an_error() {
        let full = write_e57(Full::after(2000), Uuid::nil(), points(5000).into_iter().map(Ok));
        let error = full.unwrap_err();
        let cause = std::error::Error::source(&error).unwrap();
        let cause: &io::Error = cause.downcast_ref().unwrap();
        assert_eq!(cause.kind(), io::ErrorKind::StorageFull);
    }
}
