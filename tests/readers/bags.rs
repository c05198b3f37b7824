//! ROS 2 bags (ros2/rosbag2; mcap.dev/spec; ros2/common_interfaces).

mod poses;
mod unchosen;
mod unread;

use crate::databases::{Value, database, packed_by_rvl};
use crate::recording::{Recorded, Recording, quaternion};
use crate::writers::{Files, as_folder};
use nalgebra::{Matrix3, Matrix4};
use tempfile::TempDir;
use viola_formats::clip::{Clip, ClipError};

/// A message before it is in a file: time, topic, type, CDR.
pub type Message = (f64, &'static str, &'static str, Vec<u8>);

const DEPTH: &str = "/camera/depth/image_rect_raw";
const COLOR: &str = "/camera/color/image_raw";
const IMAGE: &str = "sensor_msgs/msg/Image";
const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";
const INFO: &str = "sensor_msgs/msg/CameraInfo";
const ODOMETRY: &str = "nav_msgs/msg/Odometry";
const POSE: &str = "geometry_msgs/msg/PoseStamped";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";

/// Messages with the poses of the robot's base.
#[derive(Clone, Copy, PartialEq)]
pub enum PosesBy {
    Odometry,
    PoseStamped,
    /// The tree of frames.
    Tree,
}

/// CDR, least significant byte first.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new() -> Cdr {
        Cdr(vec![0, 1, 0, 0])
    }

    fn put<const N: usize>(mut self, bytes: [u8; N]) -> Cdr {
        while !(self.0.len() - 4).is_multiple_of(N) {
            self.0.push(0);
        }
        self.0.extend(bytes);
        self
    }

    fn u32(self, value: u32) -> Cdr {
        self.put(value.to_le_bytes())
    }

    fn f64s(self, values: &[f64]) -> Cdr {
        values.iter().fold(self, |cdr, value| cdr.put(value.to_le_bytes()))
    }

    fn bytes(self, bytes: &[u8]) -> Cdr {
        let mut cdr = self.u32(bytes.len() as u32);
        cdr.0.extend(bytes);
        cdr
    }

    fn text(self, text: &str) -> Cdr {
        self.bytes(&[text.as_bytes(), &[0]].concat())
    }

    fn header(self, time_s: f64, frame: &str) -> Cdr {
        let nanoseconds = (time_s.fract() * 1e9).round() as u32;
        self.u32(time_s as u32).u32(nanoseconds).text(frame)
    }

    fn pose(self, pose: &Matrix4<f64>) -> Cdr {
        self.f64s(&[pose[(0, 3)], pose[(1, 3)], pose[(2, 3)]]).f64s(&quaternion(pose))
    }
}

/// The camera on a robot: it looks ahead from 0.4 m above the base.
fn base_from_link() -> Matrix4<f64> {
    Matrix4::new_translation(&nalgebra::Vector3::new(0.1, 0.02, 0.4))
        * nalgebra::Rotation3::from_euler_angles(0.01, 0.2, -0.05).to_homogeneous()
}

fn link_from_optical() -> Matrix4<f64> {
    Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0).to_homogeneous()
}

fn camera_info(time_s: f64, frame: &str, size: (u32, u32), [fx, fy, cx, cy]: [f64; 4]) -> Vec<u8> {
    let k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
    let r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    let cdr = Cdr::new().header(time_s, frame).u32(size.1).u32(size.0).text("plumb_bob").u32(5);
    let cdr = cdr.f64s(&[0.0; 5]).f64s(&k).f64s(&r).f64s(&p);
    // Binning and the region of interest.
    cdr.u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).put([0]).0
}

fn transform(time_s: f64, parent: &str, child: &str, pose: &Matrix4<f64>) -> Vec<u8> {
    Cdr::new().u32(1).header(time_s, parent).text(child).pose(pose).0
}

fn odometry(time_s: f64, pose: &Matrix4<f64>) -> Vec<u8> {
    // Covariances and the twist.
    Cdr::new().header(time_s, "odom").text("base_link").pose(pose).f64s(&[0.0; 36 + 6 + 36]).0
}

fn pose_stamped(time_s: f64, pose: &Matrix4<f64>) -> Vec<u8> {
    Cdr::new().header(time_s, "odom").pose(pose).0
}

/// Returns the depth picture of a frame: millimetres, or metres in rows with padding.
fn depth(recording: &Recording, index: usize) -> Vec<u8> {
    let frame = &recording.frames[index];
    let (width, height) = recording.depth_size;
    let cdr = Cdr::new().header(frame.time_s, "camera_depth_optical_frame").u32(height).u32(width);
    if index.is_multiple_of(2) {
        let bytes: Vec<u8> = frame.depth_mm.iter().flat_map(|mm| mm.to_le_bytes()).collect();
        return cdr.text("16UC1").put([0]).u32(2 * width).bytes(&bytes).0;
    }
    let metres = |mm: &u16| if *mm == 0 { f32::NAN } else { f32::from(*mm) / 1000.0 };
    let row = |row: &[u16]| -> Vec<u8> {
        row.iter().flat_map(|mm| metres(mm).to_be_bytes()).chain([0; 12]).collect()
    };
    let bytes: Vec<u8> = frame.depth_mm.chunks(width as usize).flat_map(row).collect();
    cdr.text("32FC1").put([1]).u32(4 * width + 12).bytes(&bytes).0
}

fn color(recording: &Recording, index: usize) -> Vec<u8> {
    let frame = &recording.frames[index];
    let image = image::load_from_memory(&frame.jpeg).unwrap().into_rgb8();
    let (width, height) = image.dimensions();
    let bgr: Vec<u8> = image.pixels().flat_map(|pixel| [pixel.0[2], pixel.0[1], pixel.0[0]]).collect();
    let cdr = Cdr::new().header(frame.time_s + 0.004, "camera_depth_optical_frame");
    cdr.u32(height).u32(width).text("bgr8").put([0]).u32(3 * width).bytes(&bgr).0
}

/// Returns the messages of a robot's recording.
pub fn messages(recording: &Recording, poses_by: PosesBy) -> Vec<Message> {
    let mut messages = Vec::new();
    let start_s = recording.frames[0].time_s;
    let frame = "camera_depth_optical_frame";
    let info = "/camera/depth/camera_info";
    messages.push((
        start_s,
        info,
        INFO,
        camera_info(start_s, frame, recording.depth_size, recording.depth_k),
    ));
    let info = "/camera/color/camera_info";
    messages.push((
        start_s,
        info,
        INFO,
        camera_info(start_s, frame, recording.color_size, recording.color_k()),
    ));
    for (parent, child, pose) in
        [("camera_link", frame, link_from_optical()), ("base_link", "camera_link", base_from_link())]
    {
        messages.push((start_s, "/tf_static", TRANSFORMS, transform(start_s, parent, child, &pose)));
    }
    let camera_from_base = (base_from_link() * link_from_optical()).try_inverse().unwrap();
    for (index, frame) in recording.frames.iter().enumerate() {
        let pose = frame.world_from_camera * camera_from_base;
        // The poses around a picture are the same, so that the one between them is known.
        for time_s in [frame.time_s - 0.02, frame.time_s + 0.03] {
            messages.push(match poses_by {
                PosesBy::Odometry => (time_s, "/odom", ODOMETRY, odometry(time_s, &pose)),
                PosesBy::PoseStamped => (time_s, "/pose", POSE, pose_stamped(time_s, &pose)),
                PosesBy::Tree => (time_s, "/tf", TRANSFORMS, transform(time_s, "odom", "base_link", &pose)),
            });
        }
        messages.push((frame.time_s, DEPTH, IMAGE, depth(recording, index)));
        messages.push((frame.time_s, COLOR, IMAGE, color(recording, index)));
    }
    messages
}

/// Returns depth as the PNG of `compressedDepth`, behind its parameters.
fn depth_png(recording: &Recording, frame: &Recorded) -> (&'static str, Vec<u8>) {
    ("16UC1; compressedDepth png", [&[0; 12][..], &recording.depth_png(frame)].concat())
}

/// Returns depth packed by RVL, behind the parameters of `compressedDepth` and the picture's width and height.
fn depth_rvl(recording: &Recording, frame: &Recorded) -> (&'static str, Vec<u8>) {
    let (width, height) = recording.depth_size;
    let sides = [width.to_le_bytes(), height.to_le_bytes()].concat();
    ("16UC1; compressedDepth rvl", [&[0; 12][..], &sides, &packed_by_rvl(&frame.depth_mm)].concat())
}

type PackDepth = fn(&Recording, &Recorded) -> (&'static str, Vec<u8>);

/// Returns the same with colour as JPEG and depth as `compressedDepth`.
fn compressed(recording: &Recording, pack: PackDepth) -> Vec<Message> {
    let mut messages = messages(recording, PosesBy::Odometry);
    messages.retain(|(_, topic, ..)| *topic != DEPTH && *topic != COLOR);
    for frame in &recording.frames {
        let header = || Cdr::new().header(frame.time_s, "camera_depth_optical_frame");
        let jpeg = header().text("bgr8; jpeg compressed bgr8").bytes(&frame.jpeg).0;
        messages.push((frame.time_s, "/camera/color/image_raw/compressed", COMPRESSED, jpeg));
        let (format, depth) = pack(recording, frame);
        let depth = header().text(format).bytes(&depth).0;
        messages.push((frame.time_s, "/camera/depth/image_rect_raw/compressedDepth", COMPRESSED, depth));
    }
    messages
}

pub fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

pub fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// Returns an MCAP file; `pack` compresses a chunk.
pub fn mcap_file(messages: &[Message], compression: &str, pack: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let mut records = Vec::new();
    let mut topics: Vec<&str> = Vec::new();
    for (time_s, topic, kind, cdr) in messages {
        let known = topics.iter().position(|known| known == topic);
        let id = known.unwrap_or_else(|| {
            topics.push(topic);
            let id = topics.len() as u16;
            let schema =
                [&id.to_le_bytes()[..], &text(kind), &text("ros2msg"), &text("# its definition")].concat();
            records.extend(record(3, &schema));
            let channel =
                [&(id - 1).to_le_bytes()[..], &id.to_le_bytes(), &text(topic), &text("cdr"), &[0; 4]];
            records.extend(record(4, &channel.concat()));
            topics.len() - 1
        }) as u16;
        let time_ns = ((time_s * 1e9) as u64).to_le_bytes();
        records.extend(record(5, &[&id.to_le_bytes()[..], &[0; 4], &time_ns, &time_ns, cdr].concat()));
    }
    let packed = pack(&records);
    let chunk = [
        &[0; 16][..],
        &(records.len() as u64).to_le_bytes(),
        &[0; 4],
        &text(compression),
        &(packed.len() as u64).to_le_bytes(),
        &packed,
    ];
    let magic = b"\x89MCAP0\r\n";
    let header = record(1, &[text("ros2"), text("the tests")].concat());
    [&magic[..], &header, &record(6, &chunk.concat()), &record(15, &[0; 4]), &record(2, &[0; 20]), magic]
        .concat()
}

/// Returns a folder with a bag of these messages.
fn folder_of(messages: &[Message]) -> TempDir {
    as_folder(&[("bag.mcap".to_owned(), mcap_file(messages, "", <[u8]>::to_vec))])
}

fn open(messages: &[Message]) -> Result<Clip, ClipError> {
    Clip::open(folder_of(messages).path())
}

/// Returns an LZ4 frame of stored blocks.
fn lz4(bytes: &[u8]) -> Vec<u8> {
    let mut frame = vec![4, 0x22, 0x4d, 0x18, 0x60, 0x40, 0x82];
    for block in bytes.chunks(60_000) {
        frame.extend((block.len() as u32 | 1 << 31).to_le_bytes());
        frame.extend(block);
    }
    frame.extend([0; 4]);
    frame
}

pub fn mcap(root: &str, recording: &Recording) -> Files {
    let file = mcap_file(&messages(recording, PosesBy::Odometry), "zstd", crate::archives::zstd);
    vec![(format!("{root}bag_0.mcap"), file)]
}

/// By the tree of frames, in two files without compression and with lz4.
pub fn mcap_split(root: &str, recording: &Recording) -> Files {
    let messages = messages(recording, PosesBy::Tree);
    let (first, second) = messages.split_at(messages.len() / 2);
    vec![
        (format!("{root}bag_0.mcap"), mcap_file(first, "", <[u8]>::to_vec)),
        (format!("{root}bag_1.mcap"), mcap_file(second, "lz4", lz4)),
        (format!("{root}metadata.yaml"), b"rosbag2_bagfile_information:\n  version: 9\n".to_vec()),
    ]
}

const DB3: &str = "\
PRAGMA page_size = 512;
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT \
     NULL,offered_qos_profiles TEXT NOT NULL,type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT \
     NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC)";

pub fn db3(root: &str, recording: &Recording) -> Files {
    let mut topics: Vec<&str> = Vec::new();
    let mut rows = Vec::new();
    for (time_s, topic, kind, cdr) in compressed(recording, depth_png) {
        if !topics.contains(&topic) {
            topics.push(topic);
            let values = [topic, kind].map(|text| Value::Text(text.to_string()));
            rows.push(("INSERT INTO topics VALUES (NULL, ?, ?, 'cdr', '', '')", values.into()));
        }
        let id = topics.iter().position(|known| *known == topic).unwrap() + 1;
        let values = vec![Value::Whole(id as i64), Value::Whole((time_s * 1e9) as i64), Value::Blob(cdr)];
        rows.push(("INSERT INTO messages VALUES (NULL, ?, ?, ?)", values));
    }
    // The table has several levels of pages.
    for at in 0..40 {
        let cdr = odometry(1.0 + 0.01 * f64::from(at), &Matrix4::identity());
        rows.push(("INSERT INTO messages VALUES (NULL, 99, 0, ?)", vec![Value::Blob(cdr)]));
    }
    vec![(format!("{root}bag_0.db3"), database(DB3, rows))]
}

/// Cameras of other kinds once made a bag unreadable.
#[test]
fn pictures_without_or_with_too_many_pixels_are_passed_over() {
    let recording = Recording::small(4);
    let mut messages = messages(&recording, PosesBy::Odometry);
    for (topic, (width, height)) in [("/other/image_raw", (0, 0)), ("/large/image_raw", (60_000, 60_000))] {
        let cdr = Cdr::new().header(messages[0].0, "camera").u32(height).u32(width).text("mono8");
        messages.push((messages[0].0, topic, IMAGE, cdr.put([0]).u32(width).bytes(&[]).0));
    }
    crate::exports::check(folder_of(&messages).path(), "ros2_bag", true, &recording);
}

/// A ZED's confidence from 0 to 100, in the frame of depth and colour, was once read as depth.
#[test]
fn confidence_disparity_and_amplitude_are_not_read_as_depth() {
    let recording = Recording::small(4);
    let mut messages = messages(&recording, PosesBy::Odometry);
    let (width, height) = recording.depth_size;
    let values = 100f32.to_le_bytes().repeat((width * height) as usize);
    for frame in &recording.frames {
        for topic in ["/camera/confidence/confidence_map", "/aligned_disparity", "/camera/amplitude"] {
            let cdr = Cdr::new().header(frame.time_s, "camera_depth_optical_frame").u32(height).u32(width);
            let cdr = cdr.text("32FC1").put([0]).u32(4 * width).bytes(&values);
            messages.push((frame.time_s, topic, IMAGE, cdr.0));
        }
    }
    crate::exports::check(folder_of(&messages).path(), "ros2_bag", true, &recording);
}

#[test]
fn depth_packed_by_rvl_and_stamped_poses_are_read() {
    let recording = Recording::small(4);
    for messages in [compressed(&recording, depth_rvl), messages(&recording, PosesBy::PoseStamped)] {
        crate::exports::check(folder_of(&messages).path(), "ros2_bag", true, &recording);
    }
}
