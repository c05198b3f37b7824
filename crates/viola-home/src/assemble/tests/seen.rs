//! The part of a room that a clip saw.

use super::*;
use crate::MAP_VOXEL_M;
use viola_geometry::Vector3;
use viola_reconstruct::{CloudPoint, PointCloud};

pub fn point(position: [f64; 3], normal: Vector3, class: Class, color: [u8; 3]) -> CloudPoint {
    CloudPoint {
        position_m: position.map(|c| c as f32),
        normal: normal.map(|c| c as f32).into(),
        color,
        label: Label::new(class, 0.9, 3),
        weight: 100,
    }
}

/// Returns the contribution of a clip at `map_from_clip` that saw these points of the map.
pub fn seen(points: Vec<CloudPoint>, map_from_clip: &Pose2) -> ClipContribution {
    let clip_from_map = floor_correction::pose_in_space(map_from_clip, &FloorCorrection::default()).inverse();
    let cloud_in_map = PointCloud { points, voxel_m: MAP_VOXEL_M };
    ClipContribution::new(cloud_in_map.transformed(&clip_from_map), Vec::new())
}

/// A room of 4 x 3 m with a pillar, seen by a clip at `map_from_clip`; `box_m` is the place of a crate in it.
pub fn room(map_from_clip: &Pose2, box_m: Option<[f64; 2]>) -> ClipContribution {
    let mut points = Vec::new();
    let mut add = |position: [f64; 3], normal: Vector3, class: Class, color: [u8; 3]| {
        points.push(point(position, normal, class, color));
    };
    let step = 0.03;
    for up in 0..70 {
        let z = f64::from(up) * step;
        for along in 0..133 {
            let x = f64::from(along) * step;
            add([x, 0.0, z], Vector3::y(), Class::Wall, [200, 200, 200]);
            add([x, 3.0, z], -Vector3::y(), Class::Wall, [90, 120, 160]);
        }
        for along in 0..100 {
            let y = f64::from(along) * step;
            add([0.0, y, z], Vector3::x(), Class::Wall, [160, 90, 60]);
            add([4.0, y, z], -Vector3::x(), Class::Wall, [60, 160, 90]);
        }
        for along in 0..20 {
            let s = f64::from(along) * step;
            add([1.2 + s, 1.0, z], -Vector3::y(), Class::Wall, [20, 20, 20]);
            add([1.2, 1.0 + s, z], -Vector3::x(), Class::Wall, [20, 20, 20]);
            if let Some([x, y]) = box_m {
                add([x + s, y, z], -Vector3::y(), Class::Box, [250, 10, 10]);
            }
        }
    }
    seen(points, map_from_clip)
}
