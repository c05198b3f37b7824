//! SQLite databases, written by SQLite itself: RTAB-Map's (introlab/rtabmap, DatabaseSchema.sql, CameraModel.cpp,
//! Compression.cpp).

use crate::recording::Recording;
use crate::refusals::check_error;
use crate::robot_files::zlib;
use crate::writers::{Files, as_folder, encode};
use nalgebra::{Matrix3, Matrix4, Rotation3};
use sqlx::{AssertSqlSafe, Connection, SqliteConnection};
use viola_formats::clip::Clip;

pub enum Value {
    Whole(i64),
    Real(f64),
    Text(String),
    Blob(Vec<u8>),
    Null,
}

/// Runs a statement without values, and then statements with values, in a new database; returns its file.
pub fn database(schema: &str, rows: Vec<(&str, Vec<Value>)>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new.db");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let url = format!("sqlite://{}?mode=rwc", path.display());
        let mut connection = SqliteConnection::connect(&url).await.unwrap();
        sqlx::raw_sql(AssertSqlSafe(format!("{schema}; BEGIN"))).execute(&mut connection).await.unwrap();
        for (statement, values) in rows {
            let mut query = sqlx::query(AssertSqlSafe(statement.to_string()));
            for value in values {
                query = match value {
                    Value::Whole(value) => query.bind(value),
                    Value::Real(value) => query.bind(value),
                    Value::Text(value) => query.bind(value),
                    Value::Blob(value) => query.bind(value),
                    Value::Null => query.bind(None::<Vec<u8>>),
                };
            }
            query.execute(&mut connection).await.unwrap();
        }
        sqlx::raw_sql("COMMIT").execute(&mut connection).await.unwrap();
        connection.close().await.unwrap();
    });
    std::fs::read(path).unwrap()
}

/// The tables of version 0.23 that are read, with their comments.
const RTABMAP: &str = "\
CREATE TABLE Node (
	id INTEGER NOT NULL,
	map_id INTEGER NOT NULL,
	weight INTEGER,
	stamp FLOAT,
	pose BLOB,                -- 3x4 float
	label TEXT,
	time_enter DATE,
	PRIMARY KEY (id)
);
CREATE TABLE Data (
	id INTEGER NOT NULL,
	image BLOB,               -- compressed image (Grayscale or RGB)
	depth BLOB,               -- compressed image (Depth or Right image)
	depth_confidence BLOB,    -- compressed data (low=0 high=100)
	calibration BLOB,         -- fx, fy, cx, cy, [baseline,] width, height, local_transform
	scan BLOB,                -- compressed data (Laser scan)
	cell_size FLOAT,
	time_enter DATE,
	PRIMARY KEY (id)
);
CREATE TABLE Link (
	from_id INTEGER NOT NULL,
	to_id INTEGER NOT NULL,
	type INTEGER NOT NULL,    -- kNeighbor=0, kGlobalClosure=1
	transform BLOB,           -- 3x4 float
	FOREIGN KEY (from_id) REFERENCES Node(id)
);
CREATE TABLE Admin (
	version TEXT,
	opt_ids BLOB,            -- Node ids used to generate the optimized cloud/mesh
	opt_poses BLOB,          -- compressed N*3x4 float
	time_enter DATE
);
CREATE UNIQUE INDEX IDX_Node_id on Node (id);
INSERT INTO Admin(version) VALUES('0.23.0')";

/// The camera on the device: it looks ahead, is a little turned, and lies beside the origin.
fn base_from_camera() -> Matrix4<f64> {
    let optical = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let turned = Rotation3::from_euler_angles(0.02, -0.1, 0.05).matrix() * optical;
    let mut pose = turned.to_homogeneous();
    (pose[(0, 3)], pose[(1, 3)], pose[(2, 3)]) = (0.07, -0.02, 0.15);
    pose
}

fn floats(pose: &Matrix4<f64>) -> Vec<u8> {
    crate::recording::rows(pose)[..12].iter().flat_map(|value| (*value as f32).to_le_bytes()).collect()
}

/// Packs an array as RTAB-Map does: zlib, then rows, columns and type.
fn packed(values: &[u8], columns: usize, kind: i32) -> Vec<u8> {
    let numbers = [1, columns as i32, kind].into_iter().flat_map(i32::to_le_bytes);
    zlib(values).into_iter().chain(numbers).collect()
}

fn calibration(recording: &Recording) -> Vec<u8> {
    let (width, height) = recording.color_size;
    let [fx, fy, cx, cy] = recording.color_k();
    let header = [0, 23, 1, 0, width as i32, height as i32, 9, 5, 0, 12, 12];
    let matrices = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = header.into_iter().flat_map(i32::to_le_bytes).collect();
    bytes.extend(matrices.into_iter().chain(projection).flat_map(f64::to_le_bytes));
    bytes.extend(floats(&base_from_camera()));
    bytes
}

/// Returns the confidence of each reading in percent, packed as an array of bytes.
fn confidence(recording: &Recording) -> Vec<u8> {
    let (width, height) = recording.depth_size;
    let size = [height, width, 0].into_iter().flat_map(u32::to_le_bytes);
    zlib(&recording.confidence(50)).into_iter().chain(size).collect()
}

/// Returns readings packed with RVL (Wilson, 2017).
pub fn packed_by_rvl(depth_mm: &[u16]) -> Vec<u8> {
    let mut nibbles = Vec::new();
    let mut put = |mut value: u32| {
        while value > 7 {
            nibbles.push(8 | (value & 7));
            value >>= 3;
        }
        nibbles.push(value);
    };
    let (mut rest, mut last) = (depth_mm, 0);
    while !rest.is_empty() {
        let zeros = rest.iter().take_while(|mm| **mm == 0).count();
        let valid = rest[zeros..].iter().take_while(|mm| **mm != 0).count();
        put(zeros as u32);
        put(valid as u32);
        for &mm in &rest[zeros..zeros + valid] {
            let difference = i32::from(mm) - last;
            put(((difference << 1) ^ (difference >> 31)) as u32);
            last = i32::from(mm);
        }
        rest = &rest[zeros + valid..];
    }
    nibbles.resize(nibbles.len().next_multiple_of(8), 0);
    let words = nibbles.chunks(8).map(|eight| eight.iter().fold(0, |word, nibble| (word << 4) | nibble));
    words.flat_map(u32::to_le_bytes).collect()
}

/// Returns packed readings after RTAB-Map's header.
fn rvl(recording: &Recording, depth_mm: &[u16]) -> Vec<u8> {
    let sides = [recording.depth_size.0, recording.depth_size.1].map(u32::to_le_bytes);
    [&b"DEPTHRVL"[..], sides.as_flattened(), &packed_by_rvl(depth_mm)].concat()
}

/// Returns a PNG whose blue, green, red and alpha are the bytes of metres.
fn float_png(recording: &Recording, depth_mm: &[u16]) -> Vec<u8> {
    let (width, height) = recording.depth_size;
    let pixel = |mm: &u16| {
        let [blue, green, red, alpha] = (f32::from(*mm) / 1000.0).to_le_bytes();
        [red, green, blue, alpha]
    };
    let image = image::RgbaImage::from_raw(width, height, depth_mm.iter().flat_map(pixel).collect());
    encode(&image.unwrap().into(), image::ImageFormat::Png)
}

/// Returns a database with depth in each of RTAB-Map's three codings, in turns, and with optimised poses.
pub fn rtabmap(root: &str, recording: &Recording) -> Files {
    with_confidence(root, recording, || Value::Blob(confidence(recording)))
}

fn with_confidence(root: &str, recording: &Recording, confidence: impl Fn() -> Value) -> Files {
    let mut rows = Vec::new();
    let (mut ids, mut poses) = (Vec::new(), Vec::new());
    for frame in &recording.frames {
        let id = i64::from(frame.number) + 1;
        let world_from_base = frame.world_from_camera * base_from_camera().try_inverse().unwrap();
        ids.extend((id as i32).to_le_bytes());
        poses.extend(floats(&world_from_base));
        // The odometry drifts.
        let drifted =
            Matrix4::new_translation(&nalgebra::Vector3::new(0.1 * id as f64, 0.0, 0.0)) * world_from_base;
        rows.push((
            "INSERT INTO Node(id, map_id, weight, stamp, pose) VALUES (?, 0, 1, ?, ?)",
            vec![Value::Whole(id), Value::Real(frame.time_s), Value::Blob(floats(&drifted))],
        ));
        let depth = match frame.number % 3 {
            0 => recording.depth_png(frame),
            1 => float_png(recording, &frame.depth_mm),
            _ => rvl(recording, &frame.depth_mm),
        };
        // Bytes after a JPEG's end: the values lie on several pages.
        let image = [&frame.jpeg[..], &vec![7; 4000 * (frame.number as usize % 3)]].concat();
        rows.push((
            "INSERT INTO Data(id, image, depth, depth_confidence, calibration, cell_size) VALUES (?, ?, ?, ?, ?, 0.0)",
            vec![
                Value::Whole(id),
                Value::Blob(image),
                Value::Blob(depth),
                confidence(),
                Value::Blob(calibration(recording)),
            ],
        ));
        rows.push(("INSERT INTO Link VALUES (?, ?, 9, NULL)", vec![Value::Whole(id), Value::Whole(id)]));
    }
    let count = recording.frames.len();
    rows.push((
        "UPDATE Admin SET opt_ids = ?, opt_poses = ?",
        vec![Value::Blob(packed(&ids, count, 4)), Value::Blob(packed(&poses, 12 * count, 5))],
    ));
    vec![(format!("{root}scan.db"), database(RTABMAP, rows))]
}

/// Databases before version 0.22 have no confidence, and other programs may write it in another form.
#[test]
fn readings_of_rtabmap_without_a_confidence_are_kept() {
    let recording = Recording::small(3);
    let (x, y) = recording.doubtful[0];
    for (confidence, is_told) in [(None, false), (Some(b"a picture of a program"), true)] {
        let value = || confidence.map_or(Value::Null, |bytes| Value::Blob(bytes.to_vec()));
        let folder = as_folder(&with_confidence("", &recording, value));
        let clip = Clip::open(folder.path()).unwrap();
        let told = clip.info().notes.iter().any(|note| note.contains("depth_confidence"));
        assert_eq!(told, is_told, "{:?}", clip.info().notes);
        for index in 0..3 {
            assert!(clip.load(index).unwrap().depth.at(x, y) > 0.0, "{confidence:?}: frame {index}");
        }
    }
}

/// Each row of the table adds poses.
#[test]
fn more_optimised_poses_than_a_clip_may_have_frames_are_refused() {
    let count = 100_001;
    let ids: Vec<u8> = (0..count as i32).flat_map(i32::to_le_bytes).collect();
    let poses = floats(&Matrix4::identity()).repeat(count);
    let values = [packed(&ids, count, 4), packed(&poses, 12 * count, 5)].map(Value::Blob);
    let row = ("INSERT INTO Admin(opt_ids, opt_poses) VALUES (?, ?)", values.into());
    let folder = as_folder(&[("scan.db".to_string(), database(RTABMAP, vec![row]))]);
    check_error(Clip::open(folder.path()).err().unwrap(), "too_many_frames", "100001 frames");
}

#[test]
fn damaged_confidence_of_rtabmap_is_refused_by_name() {
    let recording = Recording::small(3);
    let mut bytes = confidence(&recording);
    bytes[2..12].fill(0xff);
    let folder = as_folder(&with_confidence("", &recording, || Value::Blob(bytes.clone())));
    let error = Clip::open(folder.path()).unwrap().load(0).unwrap_err();
    assert_eq!(error.code(), "bad_depth", "{error}");
    assert!(error.to_string().contains("the confidence of frame 1"), "{error}");
}
