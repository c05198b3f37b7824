//! Bags and databases that cannot be read: the code and the words of the refusal, in little time and memory.

use crate::bags::{Message, PosesBy, mcap, mcap_file, messages, record, text};
use crate::databases::rtabmap;
use crate::memory::peak_bytes;
use crate::recording::Recording;
use crate::refusals::check_error;
use crate::writers::{Files, as_file, as_folder};
use std::time::{Duration, Instant};
use viola_formats::clip::Clip;

fn check(files: Files, code: &str, naming: &str) {
    let folder = as_folder(&files);
    let start = Instant::now();
    let (opened, peak) = peak_bytes(|| Clip::open(folder.path()));
    check_error(opened.err().unwrap_or_else(|| panic!("{code}, {naming}: not refused")), code, naming);
    assert!(peak < 4 << 20 && start.elapsed() < Duration::from_secs(5), "{code}, {naming}: {peak} bytes");
}

fn bag(bytes: Vec<u8>) -> Files {
    vec![("bag.mcap".to_string(), bytes)]
}

/// Returns a bag of the messages that `keep` names.
fn with(keep: impl Fn(&Message) -> bool) -> Files {
    let mut messages = messages(&Recording::small(3), PosesBy::Odometry);
    messages.retain(keep);
    bag(mcap_file(&messages, "", <[u8]>::to_vec))
}

#[test]
fn bags_are_refused_by_name() {
    let whole = mcap("", &Recording::small(3)).remove(0).1;
    for words in ["damaged or cut", "run `mcap recover`"] {
        check(bag(whole[..whole.len() / 2].to_vec()), "bad_metadata", words);
    }
    check(with(|(_, topic, ..)| !topic.contains("depth/image")), "bad_metadata", "no topic with depth");
    check(
        with(|(_, topic, ..)| !topic.contains("camera_info")),
        "missing_intrinsics",
        "/camera/depth/camera_info",
    );
    let two = vec![("a.mcap".to_string(), whole.clone()), ("b.mcap".to_string(), whole.clone())];
    check(two, "several_clips", "a.mcap");
    check(vec![("bag_0.db3.zstd".to_string(), vec![1])], "bad_metadata", "zstd -d");
    let all = messages(&Recording::small(3), PosesBy::Odometry);
    check(bag(mcap_file(&all, "snappy", <[u8]>::to_vec)), "bad_metadata", "snappy");
    check(bag(mcap_file(&all, "lz4", <[u8]>::to_vec)), "bad_metadata", "not lz4");
    let mut packed = all;
    packed.iter_mut().for_each(|(.., cdr)| *cdr = crate::archives::zstd(cdr));
    check(bag(mcap_file(&packed, "", <[u8]>::to_vec)), "bad_metadata", "compressed one by one; unpack");
}

#[test]
fn a_database_of_more_topics_than_a_bag_may_have_is_refused() {
    let schema =
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
        WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1001)
        INSERT INTO topics SELECT i, '/t' || i, 'nav_msgs/msg/Odometry', 'cdr' FROM n";
    let file = crate::databases::database(schema, Vec::new());
    check(vec![("bag_0.db3".to_string(), file)], "bad_metadata", "more than 1000 topics");
}

/// `mcap convert` keeps the messages of a ROS 1 bag as they are.
#[test]
fn recordings_of_ros_1_are_refused_with_the_way_out() {
    let file = vec![("drive.bag".to_string(), b"#ROSBAG V2.0\n\x45\0\0\0bag".to_vec())];
    check(file, "bad_metadata", "it is a bag of ROS 1; convert the bag to ROS 2");
    let schema = [&[1u8, 0][..], &text("sensor_msgs/Image"), &text("ros1msg"), &text("")].concat();
    let channel = [&[0u8, 0, 1, 0][..], &text("/depth/image_raw"), &text("ros1"), &[0; 4]].concat();
    let records = [record(3, &schema), record(4, &channel), record(2, &[0; 20])].concat();
    let magic = b"\x89MCAP0\r\n";
    check(bag([&magic[..], &records, magic].concat()), "bad_metadata", "its messages are of ROS 1");
}

#[test]
fn lengths_in_a_bag_are_not_believed() {
    let all = messages(&Recording::small(3), PosesBy::Odometry);
    let file = mcap_file(&all, "zstd", crate::archives::zstd);
    // After the magic bytes and the header: the opcode and the length of the chunk, its two times, its size.
    let chunk = 8 + 9 + 8 + 4 + 9;
    assert_eq!(file[chunk], 6);
    for (at, naming) in [(chunk + 1, "ends too early"), (chunk + 9 + 16, "more than a recording's")] {
        let mut file = file.clone();
        file[at..at + 8].copy_from_slice(&(u64::MAX / 2).to_le_bytes());
        check(bag(file), "bad_metadata", naming);
    }
    // A picture that is larger than its message.
    let mut all = all;
    for (_, topic, _, cdr) in &mut all {
        if topic.contains("depth/image") {
            // The stamp, the frame's name, then height and width.
            cdr[4 + 8 + 4 + 28..][..8].copy_from_slice(&[0, 8, 0, 0, 0, 8, 0, 0]);
        }
    }
    check(bag(mcap_file(&all, "", <[u8]>::to_vec)), "bad_metadata", "a row has 2048 pixels of 16UC1");
}

#[test]
fn databases_are_refused_by_name() {
    let whole = rtabmap("", &Recording::small(3)).remove(0).1;
    let database = |bytes: Vec<u8>| vec![("scan.db".to_string(), bytes)];
    check(database(whole[..whole.len() / 2].to_vec()), "bad_metadata", "has no page");
    // The list of tables becomes an inner page whose only child is itself.
    let mut circle = whole.clone();
    circle[100..112].copy_from_slice(&[5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]);
    check(database(circle), "bad_metadata", "too deep");
    let mut wide = whole.clone();
    wide[16..18].copy_from_slice(&[0, 7]);
    check(database(wide), "bad_metadata", "pages cannot have 7 bytes");
    // The kind of each camera: stereo. It is the fourth number of a model: version 0.23.1, a kind, the size.
    let version: Vec<u8> = [0i32, 23, 1, 0, 64, 48].into_iter().flat_map(i32::to_le_bytes).collect();
    let mut stereo = whole.clone();
    let places: Vec<usize> = (0..whole.len() - 24).filter(|at| whole[*at..].starts_with(&version)).collect();
    assert!(places.len() >= 3, "SQLite may leave copies behind");
    places.iter().for_each(|at| stereo[at + 12] = 1);
    check(database(stereo), "bad_intrinsics", "stereo");
    // Any database, alone: no clip.
    let other = crate::databases::database("CREATE TABLE notes(text)", Vec::new());
    check_error(Clip::open(as_file(&other).path()).err().unwrap(), "unknown_layout", "1 files");
}
