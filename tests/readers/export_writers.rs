//! Writers of apps' exports, each from the description of its format and not from our readers.

use crate::recording::{Recording, gl, quaternion, rows, y_up};
use crate::writers::Files;
use serde_json::json;

fn text(lines: impl IntoIterator<Item = String>) -> Vec<u8> {
    lines.into_iter().map(|line| line + "\n").collect::<String>().into_bytes()
}

fn joined(numbers: &[f64], separator: &str) -> String {
    numbers.iter().map(|v| format!("{v:.17e}")).collect::<Vec<_>>().join(separator)
}

/// Returns the files of a Stray Scanner recording without its colour.
fn stray_base(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let matrix = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
    let mut files = vec![(format!("{root}camera_matrix.csv"), text(matrix.map(|row| joined(&row, ", "))))];
    let mut odometry = vec!["timestamp, frame, x, y, z, qx, qy, qz, qw".to_string()];
    let mut imu = vec!["timestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z".to_string()];
    for frame in &recording.frames {
        let pose = y_up(&frame.world_from_camera);
        let [qx, qy, qz, qw] = quaternion(&pose);
        let (number, time_s) = (frame.number, frame.time_s);
        let row = joined(&[pose[(0, 3)], pose[(1, 3)], pose[(2, 3)], qx, qy, qz, qw], ", ");
        odometry.push(format!("{time_s:.6}, {number:06}, {row}"));
        // Gravity in the camera, then in the device: the camera's x is down the device's long side.
        let down = -pose.row(1);
        let (cam_x, cam_y, cam_z) = (down[0], -down[1], -down[2]);
        imu.push(format!("{:.6}, {}, {}, {}, 0, 0, 0", time_s + 0.002, cam_y, -cam_x, cam_z));
        files.push((format!("{root}depth/{number:06}.png"), recording.depth_png(frame)));
        files.push((format!("{root}confidence/{number:06}.png"), recording.confidence_png(2)));
    }
    files.push((format!("{root}odometry.csv"), text(odometry)));
    files.push((format!("{root}imu.csv"), text(imu)));
    files
}

/// Returns a Stray Scanner recording with pictures, as ReMap writes it.
pub fn stray(root: &str, recording: &Recording) -> Files {
    let mut files = stray_base(root, recording);
    for frame in &recording.frames {
        files.push((format!("{root}rgb/{:06}.jpg", frame.number), frame.jpeg.clone()));
    }
    files
}

/// Returns a Stray Scanner recording with its video.
pub fn stray_with_video(root: &str, recording: &Recording, video: Vec<u8>) -> Files {
    let mut files = stray_base(root, recording);
    files.push((format!("{root}rgb.mp4"), video));
    files
}

/// Packs as LZFSE; `plain` means uncompressed: a block `bvx-` with its size, and the end `bvx$`.
pub fn lzfse(bytes: &[u8], plain: bool) -> Vec<u8> {
    if plain {
        return [&b"bvx-"[..], &(bytes.len() as u32).to_le_bytes(), bytes, b"bvx$"].concat();
    }
    let mut packed = Vec::new();
    lzfse_rust::encode_bytes(bytes, &mut packed).unwrap();
    packed
}

pub fn record3d(root: &str, recording: &Recording) -> Files {
    // The world is that of the first camera.
    let first = gl(&recording.frames[0].world_from_camera).try_inverse().unwrap();
    let [fx, fy, cx, cy] = recording.color_k();
    let poses: Vec<Vec<f64>> = recording
        .frames
        .iter()
        .map(|frame| {
            let pose = first * gl(&frame.world_from_camera);
            let translation = [pose[(0, 3)], pose[(1, 3)], pose[(2, 3)]];
            [&quaternion(&pose)[..], &translation[..]].concat()
        })
        .collect();
    let metadata = json!({
        "w": recording.color_size.0, "h": recording.color_size.1,
        "dw": recording.depth_size.0, "dh": recording.depth_size.1,
        "K": [fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0],
        "perFrameIntrinsicCoeffs": recording.frames.iter().map(|_| [fx, fy, cx, cy]).collect::<Vec<_>>(),
        "fps": 10, "initPose": [0, 0, 0, 1, 0, 0, 0], "poses": poses, "cameraType": 1,
        "frameTimestamps": recording.frames.iter().map(|frame| frame.time_s).collect::<Vec<_>>(),
    });
    let mut files = vec![
        (format!("{root}metadata"), serde_json::to_vec(&metadata).unwrap()),
        (format!("{root}icon"), recording.frames[0].jpeg.clone()),
    ];
    for frame in &recording.frames {
        let number = frame.number;
        let depth: Vec<u8> =
            frame.depth_mm.iter().flat_map(|mm| (f32::from(*mm) / 1000.0).to_le_bytes()).collect();
        let plain = number % 2 == 1;
        files.push((format!("{root}rgbd/{number}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}rgbd/{number}.depth"), lzfse(&depth, plain)));
        files.push((format!("{root}rgbd/{number}.conf"), lzfse(&recording.confidence(2), plain)));
    }
    files
}

/// Returns a Polycam export with both kinds of cameras; the uncorrected ones are a metre off.
pub fn polycam(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let (width, height) = recording.color_size;
    let mut files = vec![(format!("{root}mesh_info.json"), b"{}".to_vec())];
    for frame in &recording.frames {
        let stem = (frame.time_s * 1e6).round() as u64;
        let pose = gl(&y_up(&frame.world_from_camera));
        for (folder, off_m) in [("corrected_cameras", 0.0), ("cameras", 1.0)] {
            let mut camera = json!({ "fx": fx, "fy": fy, "cx": cx, "cy": cy, "width": width, "height": height,
                "blur_score": 12.5, "timestamp": stem });
            for row in 0..3 {
                for column in 0..4 {
                    let off_m = if column == 3 { off_m } else { 0.0 };
                    camera[format!("t_{row}{column}")] = json!(pose[(row, column)] + off_m);
                }
            }
            files.push((
                format!("{root}keyframes/{folder}/{stem}.json"),
                serde_json::to_vec(&camera).unwrap(),
            ));
        }
        files.push((format!("{root}keyframes/corrected_images/{stem}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}keyframes/images/{stem}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}keyframes/depth/{stem}.png"), recording.depth_png(frame)));
        files.push((format!("{root}keyframes/confidence/{stem}.png"), recording.confidence_png(255)));
    }
    files
}

pub fn scanner_3d(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let mut files = vec![(format!("{root}info.json"), b"{\"device\": \"phone\"}".to_vec())];
    for frame in &recording.frames {
        let number = frame.number;
        let file = json!({ "cameraPoseARFrame": rows(&gl(&y_up(&frame.world_from_camera))),
            "intrinsics": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], "time": frame.time_s,
            "projectionMatrix": rows(&nalgebra::Matrix4::identity()) });
        files.push((format!("{root}frame_{number:05}.json"), serde_json::to_vec(&file).unwrap()));
        files.push((format!("{root}frame_{number:05}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}depth_{number:05}.png"), recording.depth_png(frame)));
        files.push((format!("{root}conf_{number:05}.png"), recording.confidence_png(2)));
    }
    files
}

pub fn arkit_scenes(root: &str, recording: &Recording) -> Files {
    let mut files = Files::new();
    let mut trajectory = Vec::new();
    let video = 41_069_021;
    // Colour at the depth's size, as in the data set.
    let size = recording.color_size;
    let [fx, fy, cx, cy] = recording.color_k();
    for frame in &recording.frames {
        let camera_from_world = frame.world_from_camera.try_inverse().unwrap();
        let [x, y, z, w] = quaternion(&camera_from_world);
        let turn =
            nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z)).scaled_axis();
        let t = [0, 1, 2].map(|row| camera_from_world[(row, 3)]);
        let time = format!("{:.3}", frame.time_s);
        trajectory.push(format!("{time} {}", joined(&[turn.x, turn.y, turn.z, t[0], t[1], t[2]], " ")));
        let pincam = format!("{} {} {fx:.17e} {fy:.17e} {cx:.17e} {cy:.17e}\n", size.0, size.1);
        let png =
            crate::writers::encode(&image::load_from_memory(&frame.jpeg).unwrap(), image::ImageFormat::Png);
        files.push((format!("{root}lowres_wide/{video}_{time}.png"), png));
        files.push((format!("{root}lowres_depth/{video}_{time}.png"), recording.depth_png(frame)));
        files.push((format!("{root}confidence/{video}_{time}.png"), recording.confidence_png(2)));
        files.push((format!("{root}lowres_wide_intrinsics/{video}_{time}.pincam"), pincam.into_bytes()));
    }
    files.push((format!("{root}lowres_wide.traj"), text(trajectory)));
    files
}

/// Pictures counted from 0, poses from 1.
pub fn redwood(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let (width, height) = recording.color_size;
    let camera = json!({ "width": width, "height": height,
        "intrinsic_matrix": [fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0] });
    let mut files = vec![(format!("{root}camera_intrinsic.json"), serde_json::to_vec(&camera).unwrap())];
    let mut log = Vec::new();
    for frame in &recording.frames {
        let number = frame.number;
        log.push(format!("{number} {number} {}", number + 1));
        let rows = rows(&frame.world_from_camera);
        log.extend(rows.chunks(4).map(|row| joined(row, " ")));
        files.push((format!("{root}color/{number:06}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}depth/{number:06}.png"), recording.depth_png(frame)));
    }
    files.push((format!("{root}scene/trajectory.log"), text(log)));
    files
}

pub fn nerfstudio(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let (width, height) = recording.color_size;
    let mut files = Files::new();
    let mut frames = Vec::new();
    for frame in &recording.frames {
        let number = frame.number;
        let pose = gl(&frame.world_from_camera);
        frames.push(json!({
            "file_path": format!("images/frame_{number:05}.jpg"),
            "depth_file_path": format!("./depths/frame_{number:05}.png"),
            "transform_matrix": rows(&pose).chunks(4).collect::<Vec<_>>(),
        }));
        files.push((format!("{root}images/frame_{number:05}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}depths/frame_{number:05}.png"), recording.depth_png(frame)));
    }
    let transforms = json!({ "camera_model": "OPENCV", "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": width,
        "h": height, "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "frames": frames });
    files.push((format!("{root}transforms.json"), serde_json::to_vec(&transforms).unwrap()));
    files
}

/// Returns NeRFCapture's files with metric depth, as in its streaming mode.
pub fn nerf_capture(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let (width, height) = recording.color_size;
    let mut files = Files::new();
    let mut frames = Vec::new();
    for frame in &recording.frames {
        let number = frame.number;
        let pose = gl(&y_up(&frame.world_from_camera));
        frames.push(json!({
            "file_path": format!("images/{number}"), "depth_path": format!("images/{number}.depth.png"),
            "timestamp": frame.time_s, "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": width, "h": height,
            "transform_matrix": rows(&pose).chunks(4).collect::<Vec<_>>(),
        }));
        let png =
            crate::writers::encode(&image::load_from_memory(&frame.jpeg).unwrap(), image::ImageFormat::Png);
        files.push((format!("{root}images/{number}.png"), png));
        files.push((format!("{root}images/{number}.depth.png"), recording.depth_png(frame)));
    }
    let transforms = json!({ "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": width, "h": height,
        "depth_integer_scale": 0.001, "frames": frames });
    files.push((format!("{root}transforms.json"), serde_json::to_vec(&transforms).unwrap()));
    files
}

/// Returns one `.sens` file with JPEG and zlib, as ScanNet's are.
pub fn sens(root: &str, recording: &Recording) -> Files {
    let mut bytes = Vec::new();
    let matrix = |bytes: &mut Vec<u8>, m: &nalgebra::Matrix4<f64>| {
        for value in rows(m) {
            bytes.extend((value as f32).to_le_bytes());
        }
    };
    let intrinsics = |[fx, fy, cx, cy]: [f64; 4]| {
        nalgebra::Matrix4::new(fx, 0., cx, 0., 0., fy, cy, 0., 0., 0., 1., 0., 0., 0., 0., 1.)
    };
    let identity = nalgebra::Matrix4::identity();
    bytes.extend(4u32.to_le_bytes());
    let sensor = b"StructureSensor";
    bytes.extend((sensor.len() as u64).to_le_bytes());
    bytes.extend(sensor);
    matrix(&mut bytes, &intrinsics(recording.color_k()));
    matrix(&mut bytes, &identity);
    matrix(&mut bytes, &intrinsics(recording.depth_k));
    matrix(&mut bytes, &identity);
    bytes.extend(2i32.to_le_bytes());
    bytes.extend(1i32.to_le_bytes());
    for side in
        [recording.color_size.0, recording.color_size.1, recording.depth_size.0, recording.depth_size.1]
    {
        bytes.extend(side.to_le_bytes());
    }
    bytes.extend(1000f32.to_le_bytes());
    bytes.extend((recording.frames.len() as u64).to_le_bytes());
    for frame in &recording.frames {
        let raw: Vec<u8> = frame.depth_mm.iter().flat_map(|mm| mm.to_le_bytes()).collect();
        let depth = crate::robot_files::zlib(&raw);
        matrix(&mut bytes, &frame.world_from_camera);
        let time_us = (frame.time_s * 1e6) as u64;
        for value in [time_us, time_us, frame.jpeg.len() as u64, depth.len() as u64] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(&frame.jpeg);
        bytes.extend(&depth);
    }
    // One sample of the inertial sensors: fifteen numbers and a time.
    bytes.extend(1u64.to_le_bytes());
    bytes.extend([0; 128]);
    vec![(format!("{root}scene.sens"), bytes)]
}

const FELT_BY_IMU: [f64; 3] = [0.1, 9.8, -0.2];

fn imu_turn() -> nalgebra::Rotation3<f64> {
    nalgebra::Rotation3::from_euler_angles(0.3, -1.2, 2.0)
}

/// Returns the force of each frame of [`spectacular`], in the camera.
pub fn spectacular_force_in_camera() -> nalgebra::Vector3<f64> {
    imu_turn() * nalgebra::Vector3::from(FELT_BY_IMU)
}

/// Returns a recording whose inertial sensor is offset and rotated; lines of poses lie between frames'.
pub fn spectacular(root: &str, recording: &Recording) -> Files {
    let [fx, fy, cx, cy] = recording.color_k();
    let camera_from_imu =
        nalgebra::Translation3::new(0.02, -0.05, 0.01).to_homogeneous() * imu_turn().to_homogeneous();
    let camera =
        json!({ "focalLengthX": fx, "focalLengthY": fy, "principalPointX": cx, "principalPointY": cy });
    let mut files = Files::new();
    let mut lines = Vec::new();
    for frame in &recording.frames {
        let (number, time_s) = (frame.number, frame.time_s);
        let pose = frame.world_from_camera * camera_from_imu;
        let [x, y, z, w] = quaternion(&pose);
        let entry = |off_m: f64| {
            json!({ "orientation": { "w": w, "x": x, "y": y, "z": z },
                "position": { "x": pose[(0, 3)] + off_m, "y": pose[(1, 3)], "z": pose[(2, 3)] } })
        };
        // A line has the pose of one method, or of several.
        if number.is_multiple_of(2) {
            lines.push(json!({ "time": time_s, "ARKit": entry(1.0), "groundTruth": entry(0.0) }).to_string());
        } else {
            lines.push(json!({ "time": time_s, "ARKit": entry(1.0) }).to_string());
            lines.push(json!({ "time": time_s, "groundTruth": entry(0.0) }).to_string());
        }
        lines.push(
            json!({ "sensor": { "type": "accelerometer", "values": FELT_BY_IMU }, "time": time_s })
                .to_string(),
        );
        lines.push(
            json!({ "number": number, "time": time_s, "frames": [
                { "cameraInd": 0, "cameraParameters": camera, "time": time_s,
                  "imuToCamera": rows(&camera_from_imu).chunks(4).collect::<Vec<_>>() },
                { "cameraInd": 1, "depthScale": 0.001, "time": time_s }] })
            .to_string(),
        );
        files.push((format!("{root}frames/{number:08}.jpg"), frame.jpeg.clone()));
        files.push((format!("{root}frames2/{number:08}.png"), recording.depth_png(frame)));
    }
    files.push((format!("{root}data.jsonl"), text(lines)));
    files
}
