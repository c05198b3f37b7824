use super::*;
use crate::points::tests::{Full, points};
use prost::Message;
use std::io::Cursor;
use viola_geometry::Vector3 as Vector;

fn bounds() -> UprightBox {
    UprightBox { centre_m: [1.0, 2.0, 0.4], size_m: [2.0, 0.9, 0.8], yaw_rad: std::f64::consts::FRAC_PI_2 }
}

/// A clip that is turned by a quarter in the map, with cameras along its x axis. Its frame is on a bed.
fn path(cameras: usize) -> ClipPath {
    let camera = |i: usize| Pose3::translation(i as f64, 0.0, 1.5);
    let cameras: Vec<Pose3> = (0..cameras).map(camera).collect();
    ClipPath::new(Uuid::from_u128(7), Pose2::new(10.0, 20.0, std::f64::consts::FRAC_PI_2), 0.5, &cameras)
}

fn written(paths: &[ClipPath], lidar: Option<&LidarMap>, points: &[MapPoint]) -> Vec<u8> {
    let object =
        RecordedObject { id: "sofa-1", name: None, class: Class::Sofa, confidence: 0.75, bounds: bounds() };
    let recording =
        Recording { level: LevelName::MAIN, time_ms: 1_700_000_000_123, paths, objects: &[object], lidar };
    let mut out = Cursor::new(Vec::new());
    recording.write(&mut out, points.iter().copied().map(Ok)).unwrap();
    out.into_inner()
}

/// Returns the records of a part of a file, each with its kind.
fn records(mut bytes: &[u8]) -> Vec<(u8, &[u8])> {
    let mut records = Vec::new();
    while let Some((kind, rest)) = bytes.split_first() {
        let (length, rest) = rest.split_first_chunk::<8>().unwrap();
        let (contents, rest) = rest.split_at(u64::from_le_bytes(*length) as usize);
        records.push((*kind, contents));
        bytes = rest;
    }
    records
}

/// Returns the only message of a topic, by the layout that mcap.dev gives for version 0.
fn message<M: Message + Default>(file: &[u8], topic: &str) -> M {
    let magic = b"\x89MCAP0\r\n";
    let inner = file.strip_prefix(magic).unwrap().strip_suffix(magic).unwrap();
    // A chunk's head has 32 bytes before its records, as the name of its compression is empty.
    let chunks = records(inner).into_iter().filter(|(kind, _)| *kind == 0x06);
    let inside: Vec<(u8, &[u8])> = chunks.flat_map(|(_, chunk)| records(&chunk[40..])).collect();
    let number = |bytes: &[u8]| u16::from_le_bytes([bytes[0], bytes[1]]);
    let name = [&(topic.len() as u32).to_le_bytes(), topic.as_bytes()].concat();
    let is_topic = |(kind, channel): &&(u8, &[u8])| *kind == 0x04 && channel[4..].starts_with(&name);
    let channel = number(inside.iter().find(is_topic).unwrap().1);
    let messages: Vec<&[u8]> = inside
        .iter()
        .filter(|(kind, message)| *kind == 0x05 && number(message) == channel)
        .map(|(_, message)| *message)
        .collect();
    assert_eq!(messages.len(), 1, "{topic}");
    assert_eq!(messages[0][6..14], 1_700_000_000_123_000_000_u64.to_le_bytes());
    M::decode(&messages[0][22..]).unwrap()
}

#[test]
fn points_are_written_in_parts_without_a_loss() {
    let points = points(PART_POINTS as u32 + 10);
    let file = written(&[], None, &points);
    let parts: [PointCloud; 2] = ["/map/points", "/map/points/2"].map(|topic| message(&file, topic));
    assert_eq!(parts[0].timestamp, Some(Timestamp { seconds: 1_700_000_000, nanos: 123_000_000 }));
    let data = parts.map(|part| part.data).concat();
    let want: Vec<[u8; POINT_BYTES]> = points.iter().map(point_bytes).collect();
    assert!(data == want.concat());
    let first = points[1].point;
    assert_eq!(data[24..28], first.position_m[0].to_le_bytes());
    assert_eq!((data[24 + 22], data[24 + 15]), (first.label.class.id() as u8, 255));
}

#[test]
fn a_point_that_no_picture_showed_is_grey() {
    let mut points = points(2);
    points[1].point.color = viola_reconstruct::NO_COLOR;
    let cloud: PointCloud = message(&written(&[], None, &points), "/map/points");
    assert_eq!((&cloud.data[12..15], &cloud.data[36..39]), (&points[0].point.color[..], &[150; 3][..]));
}

#[test]
fn a_map_without_points_has_an_empty_cloud() {
    let cloud: PointCloud = message(&written(&[], None, &[]), "/map/points");
    assert!(cloud.data.is_empty() && cloud.fields.len() == 10);
}

#[test]
fn paths_are_in_the_map_s_frame() {
    let file = written(&[path(3)], None, &[]);
    let poses: PosesInFrame = message(&file, "/clips/00000000-0000-0000-0000-000000000007/path");
    let at = poses.poses[2].position.clone().unwrap();
    // Two metres along the clip's x axis, which is the map's y axis.
    assert!((Vector::new(at.x, at.y, at.z) - Vector::new(10.0, 22.0, 2.0)).norm() < 1e-9);
    let transforms: FrameTransforms = message(&file, "/tf");
    let [transform] = transforms.transforms.as_slice() else { panic!("one clip") };
    assert_eq!(
        (transform.parent_frame_id.as_str(), transform.child_frame_id.as_str()),
        ("map", "clip/00000000-0000-0000-0000-000000000007")
    );
    assert_eq!(transform.translation, Some(Vector3 { x: 10.0, y: 20.0, z: 0.5 }));
    let turn = transform.rotation.clone().unwrap();
    assert!((turn.z - 0.5_f64.sqrt()).abs() < 1e-9 && (turn.w - 0.5_f64.sqrt()).abs() < 1e-9);
}

#[test]
fn a_long_path_is_thinned_evenly() {
    let path = path(1201);
    assert_eq!(path.clip_from_cameras.len(), 401);
    assert_eq!(path.clip_from_cameras[400].translation.x, 1200.0);
}

#[test]
fn objects_are_boxes_with_names() {
    let scene: SceneUpdate = message(&written(&[], None, &[]), "/objects");
    let [entity] = scene.entities.as_slice() else { panic!("one object") };
    let cube = &entity.cubes[0];
    assert_eq!(cube.size, Some(Vector3 { x: 2.0, y: 0.9, z: 0.8 }));
    let pose = cube.pose.clone().unwrap();
    assert_eq!(pose.position, Some(Vector3 { x: 1.0, y: 2.0, z: 0.4 }));
    assert!((pose.orientation.unwrap().z - 0.5_f64.sqrt()).abs() < 1e-9);
    assert_eq!((entity.id.as_str(), entity.texts[0].text.as_str()), ("sofa-1", "sofa-1"));
    let class = KeyValuePair { key: "class".to_owned(), value: "sofa".to_owned() };
    assert!(entity.metadata.contains(&class));
}

#[test]
fn the_lidar_map_is_a_grid() {
    let lidar = LidarMap::read(b"x,y\n1.0,2.0\n3.0,2.0\n3.0,5.0\n1.0,5.0\n1.5,2.0\n").unwrap();
    let grid: Grid = message(&written(&[], Some(&lidar), &[]), "/lidar_map");
    assert_eq!((grid.frame_id.as_str(), grid.data.len() % grid.row_stride as usize), ("map", 0));
}

#[test]
fn a_full_disk_is_an_error() {
    let recording = Recording { level: LevelName::MAIN, time_ms: 0, paths: &[], objects: &[], lidar: None };
    assert!(recording.write(Full::after(100), []).is_err());
    assert!(recording.write(Full::after(20_000), points(5000).into_iter().map(Ok)).is_err());
}
