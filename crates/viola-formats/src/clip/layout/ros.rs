//! ROS 2 bags, as MCAP or as rosbag2's SQLite file, alone or in a folder with `metadata.yaml`. Topics are chosen by the
//! types and contents of their messages; poses are interpolated to the depth pictures.

mod bag;
mod cdr;
mod db3;
mod frames;
mod lz4;
mod mcap;
mod message;
mod path;

use super::associate::associate;
use super::trajectory::times;
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source, incomplete, views_differ,
};
use crate::clip::files::{Part, has_ending};
use crate::container::Container;
use bag::{Bag, Images, Unread, is_infrared, is_never_chosen};
use message::CameraInfo;
use std::cmp::Reverse;
use viola_geometry::Vector3;

/// Maximum time between the pictures of a frame.
const MAX_GAP_S: f64 = 0.02;
/// Minimum distance of two cameras that is noted.
const MIN_BESIDE_M: f64 = 1e-3;
/// Maximum number of files of one bag, which the recorder splits by size.
const MAX_FILES: usize = 1000;

/// Finds a bag in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let names = container.names();
    let packed = |name: &&String| has_ending(name, ".db3.zstd") || has_ending(name, ".mcap.zstd");
    if let Some(name) = names.iter().find(packed) {
        let reason = "the whole file is compressed; unpack it with `zstd -d`, then send it".to_string();
        return Err(ClipError::BadMetadata { name: name.clone(), reason });
    }
    // A file that was sent alone may have any name.
    let is_candidate =
        |name: &&String| names.len() == 1 || has_ending(name, ".mcap") || has_ending(name, ".db3");
    let files: Vec<&String> = names.iter().filter(is_candidate).take(MAX_FILES).collect();
    let Some(first) = files.first() else { return Ok(None) };
    let folder = first.rfind('/').map_or("", |end| &first[..=end]);
    let is_split = container.contains(&format!("{folder}metadata.yaml"));
    if let Some(other) = files.iter().find(|name| !is_split && name != &first || !name.starts_with(folder)) {
        return Err(ClipError::SeveralClips { first: first.to_string(), second: other.to_string() });
    }
    let Some(bag) = Bag::read(container, &files)? else { return Ok(None) };
    let mut layout = layout(&bag, first)?;
    let has_log = |name: &&&String| container.contains(&format!("{name}-wal"));
    layout.notes.extend(files.iter().filter(has_log).map(|name| {
        format!("{name}-wal was not read: it has what the recorder wrote last; stop the recorder first")
    }));
    Ok(Some(Layout { region: Some(bag.spool.finish()?), ..layout }))
}

fn layout(bag: &Bag, name: &str) -> Result<Layout, ClipError> {
    let bad = |reason: String| ClipError::BadMetadata { name: name.to_string(), reason };
    let Some((depth_topic, depth)) = depth_topic(bag) else {
        let wanted =
            "it has no topic with depth: sensor_msgs/msg/Image of 16UC1 or 32FC1, or compressedDepth";
        let unread = unread_topic(bag, |_| true).map_or(String::new(), |words| format!("; {words}"));
        return Err(bad(format!("{wanted}{unread}")));
    };
    let Color { best, chosen, other_view, passed_over } = color(bag, depth_topic, depth);
    let of_color = chosen.or(best.filter(|_| other_view.is_none()));
    let (cameras, is_distorted) = cameras(bag, depth_topic, depth, of_color)?;
    let depth_times_s = times(&depth.pictures);
    let color_times_s = chosen.map_or(Vec::new(), |(_, color)| times(&color.pictures));
    let pairs: Vec<(Option<usize>, usize)> = if chosen.is_some() {
        let pairs = associate(&color_times_s, &depth_times_s, MAX_GAP_S);
        pairs.into_iter().map(|(color, depth)| (Some(color), depth)).collect()
    } else {
        (0..depth_times_s.len()).map(|depth| (None, depth)).collect()
    };
    let of_frames_s: Vec<f64> = pairs.iter().map(|(_, depth)| depth_times_s[*depth]).collect();
    let color_words = chosen.map_or("none".to_string(), |(topic, _)| topic.clone());
    let mut notes = vec![format!("depth is from {depth_topic}, colour from {color_words}")];
    if is_distorted {
        notes.push("the lens distortion in camera_info was not applied".to_string());
    }
    notes.extend(chosen.and_then(|(topic, color)| beside(bag, topic, depth, color)));
    let mut unread = 0;
    for (topic, images) in [Some((depth_topic, depth)), chosen].into_iter().flatten() {
        let Some(lost) = lost(bag, topic, images) else { continue };
        let Lost { count, words, reason, .. } = &lost;
        if lost.is_most {
            let advice = "record the topic again, or leave it out";
            return Err(bad(format!("{words}; the first one: {reason}; {advice}")));
        }
        notes.push(format!("{words}, and were left out; the first one: {reason}"));
        unread += count;
    }
    let camera = camera_frame(bag, depth_topic, depth);
    let path = path::find(bag, camera, &of_frames_s);
    if path.count() == 0
        && let Some(words) = path::unconnected(bag, camera)
    {
        if chosen.is_none() && passed_over.is_empty() {
            return Err(bad(format!("{words}: without colour a clip needs poses, and this one has none")));
        }
        notes.push(words);
    }
    if let (None, Some(topic)) = (chosen, other_view) {
        notes.push(without_color_of(topic, path.count() > 0).map_err(bad)?);
    }
    for Lost { words, reason, .. } in passed_over {
        if chosen.is_none() && path.count() == 0 {
            let advice = "record the topic again: without colour a clip needs poses, and this one has none";
            return Err(bad(format!("{words}; the first one: {reason}; {advice}")));
        }
        notes.push(format!("{words}, and the topic was not used; the first one: {reason}"));
    }
    if best.is_none() {
        let is_color = |topic: &str| !topic.contains("depth") && !is_infrared(topic);
        notes.extend(unread_topic(bag, is_color));
    }
    if path.count() > 0 {
        notes.push(format!("poses are from {}, interpolated to the depth pictures", path.from));
    }
    notes.extend(path.notes);
    let sources = sources(depth, chosen, &pairs, path.poses);
    Ok(Layout {
        pose_files: "/tf, /odom or /pose",
        depth_unit: "millimetres of 16 bits, or metres as 32-bit floats",
        gravity: if path.z_is_up { "world z is up (REP 105)" } else { "unknown" }.to_string(),
        up_in_world: path.z_is_up.then(Vector3::z),
        color_pictures: color_times_s.len(),
        depth_pictures: depth_times_s.len(),
        incomplete: incomplete(color_times_s.len(), depth_times_s.len(), pairs.len()) + unread,
        intrinsics: "camera_info".to_string(),
        notes,
        ..Layout::new("ros2_bag", cameras, sources)
    })
}

/// Returns a note about colour that is taken from another place than depth; `None` if it is not, or the tree does not tell.
fn beside(bag: &Bag, topic: &str, depth: &Images, color: &Images) -> Option<String> {
    let time_s = depth.pictures.first()?.time_s;
    let distance_m = bag.frames.pose(&depth.frame, &color.frame, time_s)?.translation.vector.norm();
    (distance_m > MIN_BESIDE_M).then(|| {
        format!("the camera of {topic} is {distance_m:.3} m beside that of the depth, which was not undone")
    })
}

/// Returns a note about a topic with colour of another view than the depth's, or the reason why the clip needs colour.
fn without_color_of(topic: &str, has_poses: bool) -> Result<String, String> {
    let words = format!("{topic} has another view than the depth, and was not used");
    let advice = "record depth that is aligned to colour (`aligned_depth_to_color`)";
    if has_poses {
        return Ok(format!("{words}; {advice}"));
    }
    Err(format!("{words}; {advice}: without colour a clip needs poses, and this one has none"))
}

/// Pictures of a topic that cannot be read.
struct Lost<'a> {
    count: usize,
    /// True if they are more than half of the topic's.
    is_most: bool,
    words: String,
    /// The reason of the first one.
    reason: &'a str,
}

/// Returns the pictures of a topic that cannot be read; `None` if all can.
fn lost<'a>(bag: &'a Bag, topic: &str, images: &Images) -> Option<Lost<'a>> {
    let Unread { count, reason } = bag.unread.get(topic)?;
    let all = count + images.pictures.len();
    let words = format!("{count} of {all} pictures of {topic} cannot be read");
    Some(Lost { count: *count, is_most: 2 * count > all, words, reason })
}

/// Describes the wanted topic without a picture that can be read, of several the one with depth in its name, then the one
/// with most pictures.
fn unread_topic(bag: &Bag, is_wanted: impl Fn(&str) -> bool) -> Option<String> {
    let topics = bag.unread.iter().filter(|(topic, _)| !bag.images.contains_key(*topic) && is_wanted(topic));
    let (topic, unread) = topics
        .max_by_key(|(topic, unread)| (topic.contains("depth"), unread.count, Reverse(topic.as_str())))?;
    Some(format!("no picture of {topic} can be read; the first one: {}", unread.reason))
}

/// Returns the frames in the order of time.
fn sources(
    depth: &Images,
    color: Option<(&String, &Images)>,
    pairs: &[(Option<usize>, usize)],
    poses: Vec<Option<viola_geometry::Pose3>>,
) -> Vec<Source> {
    let source = |((number, &(color_index, depth_index)), world_from_camera): (
        (usize, &(Option<usize>, usize)),
        _,
    )| {
        let number = number as u32;
        let picture = &depth.pictures[depth_index];
        let numbered = |part: Part| Part { number, ..part };
        let color = color_index.zip(color).map_or(ColorAt::Absent, |(index, (_, color))| {
            let picture = &color.pictures[index].value;
            ColorAt::Part { part: numbered(picture.part), size: picture.size }
        });
        let depth = DepthAt::Part { part: numbered(picture.value.part), size: picture.value.size };
        let time_s = Some(picture.time_s);
        Source { time_s, world_from_camera, ..Source::new(number, color, depth) }
    };
    pairs.iter().enumerate().zip(poses).map(source).collect()
}

/// Returns the frame of a topic's camera: that of its pictures, or that of its `camera_info` if the tree of frames has only
/// the latter, or if the pictures name none.
fn camera_frame<'a>(bag: &'a Bag, topic: &str, images: &'a Images) -> &'a str {
    let own = images.frame.as_str();
    let of_info = bag.cameras.get(&info_topic(topic)).map(|info| info.frame.as_str());
    let is_better = |frame: &&str| bag.frames.has(frame) || own.is_empty();
    of_info.filter(|_| !bag.frames.has(own)).filter(is_better).unwrap_or(own)
}

/// Returns the topic with depth: of several, one with depth in its name, then one that is aligned to colour, then the one
/// with most pictures.
fn depth_topic(bag: &Bag) -> Option<(&String, &Images)> {
    let is_aligned = |topic: &str| topic.contains("aligned") || topic.contains("registered");
    let has_color = |images: &Images| {
        let mut others = bag.images.iter().filter(|(topic, other)| !other.is_depth && !is_infrared(topic));
        others.any(|(_, other)| other.frame == images.frame)
    };
    let depth = bag.images.iter().filter(|(topic, images)| images.is_depth && !is_never_chosen(topic, true));
    // Infrared pictures of 16 bits look like depth.
    depth.max_by_key(|(topic, images)| {
        let is_named_depth = topic.contains("depth");
        let is_seen_by_color = is_aligned(topic) || has_color(images);
        let count = images.pictures.len();
        (!is_infrared(topic), is_named_depth, is_seen_by_color, count, Reverse(topic.as_str()))
    })
}

/// The topics with colour.
#[derive(Default)]
struct Color<'a> {
    /// The preferred one.
    best: Option<(&'a String, &'a Images)>,
    /// The one that is used.
    chosen: Option<(&'a String, &'a Images)>,
    /// One that would be used if its view were that of the depth.
    other_view: Option<&'a String>,
    /// Those that would be preferred to the one that is used, if most of their pictures could be read.
    passed_over: Vec<Lost<'a>>,
}

/// Returns the topics with colour: the preferred one has the depth's frame, or else is called so. If most of its pictures
/// cannot be read, another one of the same frame is used, or none.
fn color<'a>(bag: &'a Bag, depth_topic: &str, depth: &Images) -> Color<'a> {
    let is_called = |topic: &str| topic.contains("color") || topic.contains("rgb");
    let shared = |topic: &str| topic.chars().zip(depth_topic.chars()).take_while(|(a, b)| a == b).count();
    let mut topics: Vec<(&String, &Images)> = bag
        .images
        .iter()
        .filter(|(topic, images)| !images.is_depth && !is_never_chosen(topic, false))
        .collect();
    topics.sort_by_key(|(topic, images)| {
        let has_frame = images.frame == depth.frame;
        Reverse((has_frame, is_called(topic), shared(topic), images.pictures.len(), Reverse(topic.as_str())))
    });
    let Some(&best) = topics.first() else { return Color::default() };
    let mut color = Color { best: Some(best), ..Color::default() };
    for (topic, images) in topics.into_iter().filter(|(_, images)| images.frame == best.1.frame) {
        match lost(bag, topic, images).filter(|lost| lost.is_most) {
            Some(lost) => color.passed_over.push(lost),
            None if is_other_view(bag, (depth_topic, depth), (topic.as_str(), images)) => {
                color.other_view.get_or_insert(topic);
            }
            None => {
                color.chosen = Some((topic, images));
                break;
            }
        }
    }
    color
}

/// Returns whether two topics with intrinsics of their own have different views.
fn is_other_view(bag: &Bag, depth: (&str, &Images), color: (&str, &Images)) -> bool {
    let view_m = |(topic, images)| {
        let (Intrinsics { numbers, .. }, _) = camera(bag, topic, images)?;
        let Numbers { fx, fy, of: Of::Size(width, height), .. } = numbers else { return None };
        // Focal lengths that are none are refused later.
        (fx > 0.0 && fy > 0.0).then(|| (f64::from(width) / fx, f64::from(height) / fy))
    };
    view_m(depth).zip(view_m(color)).is_some_and(|(depth, color)| views_differ(color, depth))
}

/// Returns the intrinsics of both cameras, and whether their lenses distort.
fn cameras(
    bag: &Bag,
    depth_topic: &str,
    depth: &Images,
    color: Option<(&String, &Images)>,
) -> Result<(Cameras, bool), ClipError> {
    let of_depth = camera(bag, depth_topic, depth);
    let of_color = color.and_then(|(topic, images)| camera(bag, topic, images));
    let is_distorted = of_depth.iter().chain(&of_color).any(|(_, is_distorted)| *is_distorted);
    let cameras = match (of_depth, of_color) {
        (Some((depth, _)), Some((color, _))) => Cameras::Each { color, depth },
        // Depth that is registered to colour has its view.
        (Some((one, _)), None) | (None, Some((one, _))) => Cameras::One(one),
        (None, None) => return Err(ClipError::MissingIntrinsics { name: info_topic(depth_topic) }),
    };
    Ok((cameras, is_distorted))
}

/// Returns the intrinsics of a topic: beside it, or else of its frame and size.
fn camera(bag: &Bag, topic: &str, images: &Images) -> Option<(Intrinsics, bool)> {
    let size = images.pictures.first()?.value.size;
    let beside = info_topic(topic);
    let fits = |info: &&CameraInfo| info.frame == images.frame && info.size == size;
    let (name, info) = match bag.cameras.get(&beside) {
        Some(info) => (beside, info),
        None => {
            let (name, info) = bag.cameras.iter().find(|(_, info)| fits(info))?;
            (name.clone(), info)
        }
    };
    let is_rectified = topic.contains("rect");
    let [fx, fy, cx, cy] = if is_rectified { info.rectified } else { info.raw };
    let (width, height) = if info.size.0 > 0 && info.size.1 > 0 { info.size } else { size };
    let numbers = Numbers { fx, fy, cx, cy, of: Of::Size(width, height) };
    Some((Intrinsics { name, numbers }, info.is_distorted && !is_rectified))
}

/// Returns the name of the topic with the intrinsics of a topic's pictures.
fn info_topic(topic: &str) -> String {
    let bare = topic.strip_suffix("/compressedDepth").or(topic.strip_suffix("/compressed")).unwrap_or(topic);
    let folder = bare.rfind('/').map_or("", |end| &bare[..end]);
    format!("{folder}/camera_info")
}
