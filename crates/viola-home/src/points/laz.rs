//! A map's points as LAZ: LAS 1.4 (ASPRS, R15) in point format 7, compressed by LASzip.

use crate::MapPoint;
use las::point::{Classification, Format};
use las::{Builder, Color, Point, Transform, Vector, Vlr, Writer};
use std::io::{self, Seek, SeekFrom, Write};
use uuid::Uuid;
use viola_geometry::taxonomy::Class;

/// Coordinates are stored in steps of this length.
const STEP_M: f64 = 0.001;
/// The first of the classification codes that LAS leaves to its users (table 17).
const FIRST_OWN_CODE: u8 = 64;
/// LAS has 16 bits a channel; 8 bits are multiplied by this (table 7).
const COLOR_FACTOR: u16 = 256;
/// A frame of its own in metres, without a place on the earth (OGC 01-009).
const LOCAL_FRAME: &str = "LOCAL_CS[\"LiDAR map\",LOCAL_DATUM[\"LiDAR map\",0],UNIT[\"metre\",1],\
    AXIS[\"x\",OTHER],AXIS[\"y\",OTHER],AXIS[\"z\",UP]]\0";

/// Data types of extra bytes (table 24).
const UNSIGNED_SHORT: u8 = 3;
const FLOAT: u8 = 9;
/// Attributes beyond the point format, in their order: data type, size in bytes, name, description.
const EXTRA: [(u8, u16, &str, &str); 2] = [
    (FLOAT, 4, "probability", "of the class, 0 to 1"),
    (UNSIGNED_SHORT, 2, "clip", "index in the list of clips"),
];

/// Returns the classification code of a class: ground, unclassified, or a user-defined code.
fn las_code(class: Class) -> u8 {
    match class {
        Class::Other => 1,
        Class::Floor => 2,
        // There are fewer classes than user-defined codes.
        class => FIRST_OWN_CODE + class.id() as u8,
    }
}

/// Place of the legacy number of points, followed by the five legacy numbers of points by return, of 4 bytes each.
const LEGACY_COUNTS_AT: u64 = 107;
const LEGACY_COUNTS_BYTES: usize = 24;
/// Place of the largest and the smallest x, y and z, of 8 bytes each.
const BOUNDS_AT: u64 = 179;
const BOUNDS_BYTES: usize = 48;

/// Writes points as LAZ. `id` is the file's id.
pub fn write_laz<W: Write + Seek + Send + Sync + 'static>(
    out: W,
    id: Uuid,
    points: impl IntoIterator<Item = io::Result<MapPoint>>,
) -> io::Result<()> {
    let header = header(id).map_err(io::Error::other)?;
    let mut writer = Writer::new(Target { out, failed: None }, header).map_err(io::Error::other)?;
    let mut is_empty = true;
    for point in points {
        let point = las_point(&point?).map_err(io::Error::other)?;
        writer.write_point(point).map_err(io::Error::other)?;
        is_empty = false;
    }
    writer.close().map_err(io::Error::other)?;
    let Target { mut out, failed } = writer.into_inner().map_err(io::Error::other)?;
    if let Some(error) = failed {
        return Err(error);
    }
    // Format 7 has no legacy numbers of points (LAS 1.4 R15, 2.4); the library writes them.
    out.seek(SeekFrom::Start(LEGACY_COUNTS_AT))?;
    out.write_all(&[0; LEGACY_COUNTS_BYTES])?;
    if is_empty {
        // The library writes infinite ones.
        out.seek(SeekFrom::Start(BOUNDS_AT))?;
        out.write_all(&[0; BOUNDS_BYTES])?;
    }
    out.seek(SeekFrom::End(0))?;
    out.flush()
}

fn header(id: Uuid) -> las::Result<las::Header> {
    let mut builder = Builder::from((1, 4));
    // The first three members of a GUID are little-endian numbers (LAS 1.4 R15, 2.4). The library writes the bytes of the
    // UUID in their own order.
    builder.guid = Uuid::from_bytes(id.to_bytes_le());
    builder.generating_software = concat!("viola ", env!("CARGO_PKG_VERSION")).to_owned();
    builder.system_identifier = "MERGE".to_owned();
    builder.has_wkt_crs = true;
    builder.point_format = Format::new(7)?;
    builder.point_format.is_compressed = true;
    builder.point_format.extra_bytes = EXTRA.iter().map(|(_, bytes, ..)| bytes).sum();
    let steps = Transform { scale: STEP_M, offset: 0.0 };
    builder.transforms = Vector { x: steps, y: steps, z: steps };
    let frame = Vlr {
        user_id: "LASF_Projection".to_owned(),
        record_id: 2112,
        description: "OGC WKT".to_owned(),
        data: LOCAL_FRAME.as_bytes().to_vec(),
    };
    let extra = Vlr {
        user_id: "LASF_Spec".to_owned(),
        record_id: 4,
        description: "Extra bytes".to_owned(),
        data: EXTRA.iter().flat_map(|(kind, _, name, text)| extra_bytes(*kind, name, text)).collect(),
    };
    builder.vlrs = vec![frame, extra];
    builder.into_header()
}

/// Returns the description of an attribute (table 25).
fn extra_bytes(kind: u8, name: &str, text: &str) -> [u8; 192] {
    let mut record = [0; 192];
    record[2] = kind;
    record[4..4 + name.len()].copy_from_slice(name.as_bytes());
    record[160..160 + text.len()].copy_from_slice(text.as_bytes());
    record
}

fn las_point(MapPoint { point, clip }: &MapPoint) -> las::Result<Point> {
    let [x, y, z] = point.position_m.map(f64::from);
    let [red, green, blue] = point.color.map(|channel| u16::from(channel) * COLOR_FACTOR);
    Ok(Point {
        x,
        y,
        z,
        return_number: 1,
        number_of_returns: 1,
        classification: Classification::new(las_code(point.label.class))?,
        // Format 7 has a time; the time of a fused point is unknown.
        gps_time: Some(0.0),
        color: Some(Color::new(red, green, blue)),
        extra_bytes: [&point.label.probability().to_le_bytes()[..], &clip.to_le_bytes()].concat(),
        ..Point::default()
    })
}

/// The file to write, which never reports an error but keeps the first one: a `las::Writer` that is dropped after
/// an error closes its file, and panics if this fails too.
#[derive(Debug)]
struct Target<W> {
    out: W,
    failed: Option<io::Error>,
}

impl<W> Target<W> {
    fn hide<T>(&mut self, result: io::Result<T>, instead: T) -> io::Result<T> {
        Ok(result.unwrap_or_else(|error| {
            self.failed.get_or_insert(error);
            instead
        }))
    }
}

impl<W: Write> Write for Target<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failed.is_some() {
            return Ok(bytes.len());
        }
        let written = self.out.write(bytes);
        self.hide(written, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.out.flush();
        self.hide(flushed, ())
    }
}

impl<W: Seek> Seek for Target<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = self.out.seek(to);
        self.hide(at, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::tests::{Full, points};
    use las::Reader;
    use std::io::Cursor;
    use std::sync::{Arc, Mutex};

    #[derive(Clone, Default)]
    struct Shared(Arc<Mutex<Cursor<Vec<u8>>>>);

    impl Write for Shared {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Shared {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.lock().unwrap().seek(to)
        }
    }

    const ID: Uuid = Uuid::from_u128(0x0011_2233_4455_6677_8899_aabb_ccdd_eeff);

    fn laz(points: &[MapPoint]) -> Vec<u8> {
        let out = Shared::default();
        write_laz(out.clone(), ID, points.iter().copied().map(Ok)).unwrap();
        out.0.lock().unwrap().get_ref().clone()
    }

    #[test]
    fn points_are_read_back_to_the_millimetre() {
        let points = points(1000);
        let mut reader = Reader::new(Cursor::new(laz(&points))).unwrap();
        let header = reader.header();
        assert_eq!(header.number_of_points(), 1000);
        assert!(header.has_wkt_crs() && header.point_format().to_u8().unwrap() & 0x3f == 7);
        let all = reader.read_all().unwrap();
        for (read, written) in all.points().zip(&points) {
            let read = read.unwrap();
            let want = written.point.position_m.map(f64::from);
            for (got, want) in [read.x, read.y, read.z].into_iter().zip(want) {
                assert!((got - want).abs() <= STEP_M / 2.0 + 1e-9, "{got} {want}");
            }
            let color = read.color.unwrap();
            assert_eq!([color.red, color.green, color.blue], written.point.color.map(|c| u16::from(c) * 256));
            assert_eq!(u8::from(read.classification), las_code(written.point.label.class));
            assert_eq!(read.extra_bytes[..4], written.point.label.probability().to_le_bytes());
            assert_eq!(read.extra_bytes[4..], written.clip.to_le_bytes());
        }
    }

    /// LAS 1.4 R15, 2.4: the GUID data 1 to 3 are numbers of 4, 2 and 2 bytes, and all numbers are little-endian.
    #[test]
    fn the_id_is_written_as_las_stores_a_guid() {
        let file = laz(&points(1));
        let guid =
            [0x33, 0x22, 0x11, 0x00, 0x55, 0x44, 0x77, 0x66, 0x88, 0x99, 0xaa, 0xbb, 0xcc, 0xdd, 0xee, 0xff];
        assert_eq!(file[8..24], guid);
    }

    #[test]
    fn a_map_without_points_is_a_file_without_points() {
        let file = laz(&[]);
        assert_eq!(file[179..227], [0u8; 48]);
        let reader = Reader::new(Cursor::new(file)).unwrap();
        assert_eq!(reader.header().number_of_points(), 0);
    }

    #[test]
    fn each_class_has_a_code_of_its_own_that_las_leaves_free() {
        let mut codes: Vec<u8> = Class::ALL.iter().map(|class| las_code(*class)).collect();
        assert_eq!((las_code(Class::Other), las_code(Class::Floor), las_code(Class::Wall)), (1, 2, 66));
        assert!(codes.iter().all(|code| [1, 2].contains(code) || *code >= 64));
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), Class::ALL.len());
    }

    #[test]
    fn a_full_disk_is_an_error_and_no_panic() {
        let full = write_laz(Full::after(2000), Uuid::nil(), points(100_000).into_iter().map(Ok));
        assert_eq!(full.unwrap_err().kind(), io::ErrorKind::StorageFull);
        let broken = [Ok(points(1)[0]), Err(io::ErrorKind::UnexpectedEof.into())];
        let broken = write_laz(Full::after(usize::MAX), Uuid::nil(), broken);
        assert_eq!(broken.unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }
}
