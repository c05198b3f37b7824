//! Pictures in a bag that cannot be read.

use super::*;
use crate::exports::check_poses;
use crate::refusals::check_error;

/// Replaces the last `count` messages of a topic.
fn spoil(mut messages: Vec<Message>, topic: &str, count: usize, odd: &[u8]) -> Vec<Message> {
    let of_topic = messages.iter_mut().filter(|(_, own, ..)| *own == topic);
    of_topic.rev().take(count).for_each(|(.., cdr)| *cdr = odd.to_vec());
    messages
}

/// Returns a bare picture of 32x24 pixels.
fn bare(encoding: &str, step: u32, bytes: usize) -> Vec<u8> {
    let cdr = Cdr::new().header(5000.0, "camera_depth_optical_frame").u32(24).u32(32).text(encoding);
    cdr.put([0]).u32(step).bytes(&vec![1; bytes]).0
}

fn packed(format: &str, bytes: &[u8]) -> Vec<u8> {
    Cdr::new().header(5000.0, "camera_depth_optical_frame").text(format).bytes(bytes).0
}

/// Checks a bag of five frames, of which one picture, two, three, and all are such.
fn check(messages: &[Message], topic: &str, odd: &[u8], reason: &str) {
    let spoiled = |count: usize| open(&spoil(messages.to_vec(), topic, count, odd));
    for count in [1, 2] {
        let clip = spoiled(count).unwrap_or_else(|error| panic!("{topic}, {reason}: {error}"));
        let info = clip.info();
        // The other picture of the frame is in no frame either.
        assert_eq!((info.frames, info.skipped_incomplete), (5 - count, 2 * count), "{topic}, {reason}");
        let told = format!("{count} of 5 pictures of {topic} cannot be read, and were left out");
        assert!(has_note(&clip, &told, reason), "{told}, {reason}: {:?}", info.notes);
        check_poses(&clip, &Recording::small(5 - count as u32), topic);
    }
    // Depth is needed, and colour is not.
    let most = format!("3 of 5 pictures of {topic} cannot be read");
    let none = format!("no picture of {topic} can be read");
    for (count, told) in [(3, most), (5, none)] {
        match spoiled(count) {
            Err(error) => {
                assert!(topic.contains("depth") && error.to_string().contains(&told), "{topic}: {error}");
                check_error(error, "bad_metadata", reason);
            }
            Ok(clip) => {
                let info = clip.info();
                let found = (info.frames, info.color_width, topic.contains("depth"));
                assert_eq!(found, (5, 0, false), "{topic}");
                assert!(has_note(&clip, &told, reason), "{told}, {reason}: {:?}", info.notes);
                check_poses(&clip, &Recording::small(5), topic);
            }
        }
    }
}

/// Returns whether a clip has a note with the words and the reason, without advice for pictures that are files.
fn has_note(clip: &Clip, words: &str, reason: &str) -> bool {
    let is_such = |note: &String| note.contains(words) && note.contains(reason) && !note.contains("or copy");
    clip.info().notes.iter().any(is_such)
}

#[test]
fn a_picture_that_cannot_be_read_costs_its_frame_alone() {
    let recording = Recording::small(5);
    let messages = messages(&recording, PosesBy::Odometry);
    let whole = 32 * 24 * 2;
    for topic in [DEPTH, COLOR] {
        for (odd, reason) in [
            (bare("16UC1", 0, whole), "its step is 0 bytes, and a row has 32 pixels of 16UC1"),
            (bare("16UC1", 64, 100), "it has 100 bytes instead of 1536"),
            (bare("yuv422_yuy2", 64, whole), "its encoding yuv422_yuy2 is not read"),
            (bare("16UC1", 64, whole)[..40].to_vec(), "the message is damaged"),
        ] {
            check(&messages, topic, &odd, reason);
        }
    }
    let messages = compressed(&recording, depth_png);
    let (depth, color) =
        ("/camera/depth/image_rect_raw/compressedDepth", "/camera/color/image_raw/compressed");
    for (topic, odd, reason) in [
        (depth, packed("16UC1; compressedDepth png", &[0; 5]), "it ends too early"),
        (depth, packed("16UC1; compressedDepth rvl", &[0; 15]), "it ends too early"),
        (depth, packed("16UC1; compressedDepth png", &[0; 99]), "neither JPEG nor PNG"),
        (depth, packed("32FC1; compressedDepth rvl", &[0; 99]), "inverse depth"),
        (color, packed("bgr8; jpeg compressed bgr8", b"GIF89a"), "neither JPEG nor PNG"),
    ] {
        check(&messages, topic, &odd, reason);
    }
}

#[test]
fn a_picture_of_the_other_kind_costs_its_frame_alone() {
    let recording = Recording::small(5);
    let messages = messages(&recording, PosesBy::Odometry);
    for (topic, odd) in [(DEPTH, color(&recording, 4)), (COLOR, depth(&recording, 4))] {
        let clip = open(&spoil(messages.clone(), topic, 1, &odd)).unwrap();
        let info = clip.info();
        assert_eq!((info.frames, info.skipped_incomplete), (4, 2), "{topic}");
        let is_told = |note: &String| note.contains("the topic's first picture");
        assert!(info.notes.iter().any(is_told), "{topic}: {:?}", info.notes);
    }
}

/// A topic of colour with JPEG pictures, in a frame of the tree.
fn jpegs(recording: &Recording, frame: &str) -> Vec<Message> {
    let jpeg = |recorded: &Recorded| {
        let cdr = Cdr::new().header(recorded.time_s, frame).text("bgr8; jpeg compressed bgr8");
        (recorded.time_s, "/other/rgb/compressed", COMPRESSED, cdr.bytes(&recorded.jpeg).0)
    };
    recording.frames.iter().map(jpeg).collect()
}

#[test]
fn colour_that_cannot_be_read_is_replaced_by_another_topic_of_its_frame() {
    let recording = Recording::small(5);
    let odd = bare("yuv422_yuy2", 64, 32 * 24 * 2);
    let spoiled = spoil(messages(&recording, PosesBy::Odometry), COLOR, 3, &odd);
    for (frame, color_width) in [("camera_depth_optical_frame", 64), ("rear_optical_frame", 0)] {
        let clip = open(&[&spoiled[..], &jpegs(&recording, frame)].concat()).unwrap();
        assert_eq!((clip.info().frames, clip.info().color_width), (5, color_width), "{frame}");
        let told = format!("3 of 5 pictures of {COLOR} cannot be read, and the topic was not used");
        assert!(has_note(&clip, &told, "yuv422_yuy2"), "{frame}: {:?}", clip.info().notes);
        check_poses(&clip, &recording, frame);
    }
    // Without poses there is nothing but colour to find them by.
    let mut without = spoiled;
    without.retain(|(_, topic, ..)| *topic != "/odom");
    for naming in [format!("3 of 5 pictures of {COLOR} cannot be read"), "needs poses".to_string()] {
        check_error(open(&without).err().unwrap(), "bad_metadata", &naming);
    }
}

/// A RealSense publishes depth of a wider view than colour, unless it is aligned to colour.
#[test]
fn colour_of_another_view_than_depth_is_not_used() {
    let recording = Recording::small(4);
    let mut wide = messages(&recording, PosesBy::Odometry);
    let start_s = recording.frames[0].time_s;
    let [fx, fy, cx, cy] = recording.depth_k;
    let (frame, k) = ("camera_depth_optical_frame", [0.6 * fx, 0.6 * fy, cx, cy]);
    for (_, topic, _, cdr) in &mut wide {
        if *topic == "/camera/depth/camera_info" {
            *cdr = camera_info(start_s, frame, recording.depth_size, k);
        }
    }
    let clip = open(&wide).unwrap();
    assert_eq!((clip.info().frames, clip.info().color_width), (4, 0));
    let told = format!("{COLOR} has another view than the depth");
    assert!(has_note(&clip, &told, "aligned_depth_to_color"), "{:?}", clip.info().notes);
    check_poses(&clip, &recording, "another view");
    wide.retain(|(_, topic, ..)| *topic != "/odom");
    for naming in [told.as_str(), "needs poses"] {
        check_error(open(&wide).err().unwrap(), "bad_metadata", naming);
    }
}

#[test]
fn colour_from_beside_the_depth_is_noted() {
    let recording = Recording::small(4);
    let mut messages = messages(&recording, PosesBy::Odometry);
    messages.retain(|(_, topic, ..)| *topic != COLOR);
    messages.extend(jpegs(&recording, "camera_color_optical_frame"));
    let link_from_color =
        Matrix4::new_translation(&nalgebra::Vector3::new(0.0, 0.05, 0.0)) * link_from_optical();
    let start_s = recording.frames[0].time_s;
    let of_color = transform(start_s, "camera_link", "camera_color_optical_frame", &link_from_color);
    messages.push((start_s, "/tf_static", TRANSFORMS, of_color));
    let clip = open(&messages).unwrap();
    assert_eq!((clip.info().frames, clip.info().color_width), (4, recording.color_size.0));
    let told = "the camera of /other/rgb/compressed is 0.050 m beside that of the depth";
    assert!(has_note(&clip, told, "not undone"), "{:?}", clip.info().notes);
}
