//! The files of a bag, and what their messages hold: places of pictures, intrinsics and poses.

use super::frames::Frames;
use super::message::{self, CameraInfo, Image, Kind, MAX_TOPICS, ROS_1_ADVICE, Transform, Visit};
use super::{db3, mcap};
use crate::clip::files::Part;
use crate::clip::layout::trajectory::Timed;
use crate::clip::sqlite::Database;
use crate::clip::{ClipError, MAX_FRAMES};
use crate::container::{Container, ContainerError, Spool};
use std::collections::BTreeMap;
use viola_geometry::Pose3;

const MAX_FILE_BYTES: u64 = 64 << 30;
/// Maximum size of the pictures of a bag after chunks are unpacked.
const MAX_PICTURES_BYTES: u64 = 16 << 30;
/// The first bytes of a bag of ROS 1 (wiki.ros.org/Bags/Format/2.0).
const ROS_1: &[u8; 8] = b"#ROSBAG ";
/// Begins a message that is packed by itself (`ros2 bag record --compression-mode message`); CDR begins with 0.
const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// Pictures of a few cameras.
const MAX_PICTURES: usize = 4 * MAX_FRAMES;
/// Poses of several sensors at 100 Hz for half an hour.
const MAX_POSES: usize = 1_000_000;

/// Pictures of one topic in the order of time; none of a topic that is never chosen.
pub(super) struct Images {
    pub frame: String,
    pub is_depth: bool,
    pub pictures: Vec<Timed<Picture>>,
}

pub(super) struct Picture {
    pub part: Part,
    pub size: (u32, u32),
}

/// Pictures of one topic that cannot be read.
pub(super) struct Unread {
    pub count: usize,
    /// The reason of the first one.
    pub reason: String,
}

/// Poses of one topic in the order of time.
pub(super) struct Poses {
    pub world: String,
    /// Empty if the messages do not name the moving frame.
    pub child: String,
    pub poses: Vec<Timed<Pose3>>,
}

/// The content of a bag.
pub(super) struct Bag {
    /// The pictures' bytes: messages lie in chunks, on scattered pages or in several files.
    pub spool: Spool,
    pub images: BTreeMap<String, Images>,
    pub unread: BTreeMap<String, Unread>,
    pub cameras: BTreeMap<String, CameraInfo>,
    pub odometry: BTreeMap<String, Poses>,
    pub poses: BTreeMap<String, Poses>,
    pub frames: Frames,
    pictures: usize,
    pose_count: usize,
}

impl Bag {
    /// Returns a bag without messages.
    pub fn new(spool: Spool) -> Bag {
        Bag {
            spool,
            images: BTreeMap::new(),
            unread: BTreeMap::new(),
            cameras: BTreeMap::new(),
            odometry: BTreeMap::new(),
            poses: BTreeMap::new(),
            frames: Frames::default(),
            pictures: 0,
            pose_count: 0,
        }
    }

    /// Reads the files of a bag; returns `None` if one of them is not a bag's.
    pub fn read(container: &dyn Container, names: &[&String]) -> Result<Option<Bag>, ClipError> {
        let mut bag = Bag::new(Spool::new(&container.scratch(), MAX_PICTURES_BYTES)?);
        for name in names {
            let region = container.region(name, MAX_FILE_BYTES)?;
            let unreadable = |source| ContainerError::Unreadable { name: name.to_string(), source };
            let head = region.head::<8>().map_err(unreadable)?;
            if head.as_ref() == Some(ROS_1) {
                let reason = format!("it is a bag of ROS 1; {ROS_1_ADVICE}");
                return Err(ClipError::BadMetadata { name: name.to_string(), reason });
            }
            let visit: Visit = &mut |topic, kind, message| bag.add(name, topic, kind, message);
            if head.as_ref() == Some(mcap::MAGIC) {
                mcap::read(&region, name, visit)?;
                continue;
            }
            match Database::open(&region, name)? {
                Some(database) if db3::tables(&database).is_some() => db3::read(&database, name, visit)?,
                _ => return Ok(None),
            }
        }
        bag.sort();
        Ok(Some(bag))
    }

    /// Sorts the pictures and the poses by time.
    fn sort(&mut self) {
        for images in self.images.values_mut() {
            images.pictures.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        }
        for topic in self.odometry.values_mut().chain(self.poses.values_mut()) {
            topic.poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        }
        self.frames.sort();
    }

    fn add(&mut self, name: &str, topic: &str, kind: Kind, message: &[u8]) -> Result<(), ClipError> {
        let bad = |reason: String| ClipError::BadMetadata { name: name.to_string(), reason };
        let damaged = || bad(format!("a message of {topic} is damaged"));
        if message.starts_with(ZSTD) {
            let advice = "unpack the bag with `rosbags-convert --src FOLDER --dst OTHER_FOLDER`";
            return Err(bad(format!("its messages are compressed one by one; {advice}")));
        }
        let topics = self.images.len() + self.unread.len() + self.cameras.len();
        if topics + self.odometry.len() + self.poses.len() > MAX_TOPICS {
            return Err(bad(format!("there are more than {MAX_TOPICS} topics")));
        }
        match kind {
            Kind::Image | Kind::CompressedImage => {
                let is_bare = kind == Kind::Image;
                let image =
                    if is_bare { message::image(message) } else { message::compressed_image(message) };
                match image.unwrap_or_else(|| Err("the message is damaged".to_string())) {
                    Ok(image) => self.add_image(topic, image, message)?,
                    Err(reason) => self.add_unread(topic, reason),
                }
            }
            Kind::CameraInfo => {
                if !self.cameras.contains_key(topic) {
                    let camera = message::camera_info(message).ok_or_else(damaged)?;
                    self.cameras.insert(topic.to_string(), camera);
                }
            }
            Kind::Odometry => {
                let transform = message::odometry(message).ok_or_else(damaged)?;
                self.count_poses(1).map_err(bad)?;
                add_pose(&mut self.odometry, topic, transform);
            }
            Kind::PoseStamped => {
                let transform = message::pose_stamped(message).ok_or_else(damaged)?;
                self.count_poses(1).map_err(bad)?;
                add_pose(&mut self.poses, topic, transform);
            }
            Kind::Transforms => {
                let transforms = message::transforms(message).ok_or_else(damaged)?;
                self.count_poses(transforms.len()).map_err(bad)?;
                for transform in transforms {
                    self.frames.add(transform, topic.ends_with("tf_static"));
                }
            }
        }
        Ok(())
    }

    fn count_poses(&mut self, more: usize) -> Result<(), String> {
        self.pose_count += more;
        let is_many = self.pose_count > MAX_POSES;
        if is_many {
            Err(format!("there are more than {MAX_POSES} poses; split the recording into several clips"))
        } else {
            Ok(())
        }
    }

    fn add_image(&mut self, topic: &str, image: Image, message: &[u8]) -> Result<(), ClipError> {
        let Image { header, is_depth, size, coding, data } = image;
        self.pictures += 1;
        if self.pictures > MAX_PICTURES {
            return Err(ClipError::TooManyFrames { frames: self.pictures, max: MAX_PICTURES });
        }
        let images = self.images.entry(topic.to_string()).or_insert_with(|| Images {
            frame: header.frame,
            is_depth,
            pictures: Vec::new(),
        });
        if images.is_depth == is_depth {
            if is_never_chosen(topic, is_depth) {
                return Ok(());
            }
            let bytes = &message[data];
            // A message has at most `MAX_MESSAGE_BYTES`.
            let at = self.spool.append(bytes)?;
            let part = Part { at, bytes: bytes.len() as u32, coding, number: 0, confidence_bytes: 0 };
            images.pictures.push(Timed { time_s: header.time_s, value: Picture { part, size } });
        } else {
            self.add_unread(
                topic,
                "it is depth and the topic's first picture is colour, or the reverse".to_string(),
            );
        }
        Ok(())
    }

    /// Counts a picture that cannot be read; one of them costs a frame, and not the bag.
    fn add_unread(&mut self, topic: &str, reason: String) {
        let unread = self.unread.entry(topic.to_string()).or_insert(Unread { count: 0, reason });
        unread.count += 1;
    }
}

fn add_pose(topics: &mut BTreeMap<String, Poses>, topic: &str, transform: Transform) {
    let Transform { parent, child, pose } = transform;
    let topic =
        topics.entry(topic.to_string()).or_insert_with(|| Poses { world: parent, child, poses: Vec::new() });
    topic.poses.extend(pose);
}

pub(super) fn is_infrared(topic: &str) -> bool {
    topic.contains("infra") || topic.split('/').any(|part| part == "ir")
}

/// Returns whether a topic has the confidence or the disparity of depth, which look like depth: a ZED publishes its
/// confidence as 32-bit floats in the frame of depth and colour.
fn is_confidence_or_disparity(topic: &str) -> bool {
    topic.contains("confidence") || topic.contains("disparity")
}

/// Returns whether a topic is chosen neither for depth nor for colour, whatever other topics there are.
pub(super) fn is_never_chosen(topic: &str, is_depth: bool) -> bool {
    if is_depth { is_confidence_or_disparity(topic) } else { is_infrared(topic) }
}
