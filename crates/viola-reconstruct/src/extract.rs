//! Extracts surface points from a signed distance map, at sign changes between neighbouring voxels.

use super::cloud::{CloudPoint, Label, NO_COLOR};
use super::tsdf::{Block, SIDE, Tsdf, Voxel};
use rayon::prelude::*;

/// Side of a block with one voxel before it and two after it, so that no neighbour is missing.
const PADDED: usize = SIDE + 3;

/// Returns all sign changes, block by block in order of creation.
pub(super) fn surface_points(tsdf: &Tsdf, voxel_m: f64) -> Vec<CloudPoint> {
    // A few thousand blocks at a time, so that the points are not held twice.
    let mut points = Vec::new();
    for blocks in tsdf.blocks.chunks(4096) {
        let each: Vec<Vec<CloudPoint>> = blocks
            .par_iter()
            .map_init(
                || vec![f32::NAN; PADDED * PADDED * PADDED],
                |padded, block| {
                    pad(tsdf, block, padded);
                    block_points(tsdf, block, padded, voxel_m)
                },
            )
            .collect();
        points.extend(each.into_iter().flatten());
    }
    points
}

fn at(x: usize, y: usize, z: usize) -> usize {
    (z * PADDED + y) * PADDED + x
}

/// Copies the distances of a block and its surroundings; index 1 is the block's first voxel.
fn pad(tsdf: &Tsdf, block: &Block, padded: &mut [f32]) {
    // Maps a padded index along one axis to the block's offset and the voxel in that block.
    let source = |i: usize| -> (i32, usize) {
        match i {
            0 => (-1, SIDE - 1),
            i if i <= SIDE => (0, i - 1),
            i => (1, i - 1 - SIDE),
        }
    };
    let mut neighbours = [None; 27];
    for (i, neighbour) in neighbours.iter_mut().enumerate() {
        let offset = [i % 3, i / 3 % 3, i / 9].map(|d| d as i32 - 1);
        let key = [0, 1, 2].map(|axis| block.key[axis] + offset[axis]);
        *neighbour = tsdf.index.get(&key).map(|&at| &tsdf.blocks[at as usize]);
    }
    for z in 0..PADDED {
        let (bz, vz) = source(z);
        for y in 0..PADDED {
            let (by, vy) = source(y);
            for x in 0..PADDED {
                let (bx, vx) = source(x);
                let which = ((bz + 1) * 9 + (by + 1) * 3 + bx + 1) as usize;
                padded[at(x, y, z)] = neighbours[which]
                    .map_or(f32::NAN, |b: &Block| b.voxels[(vz * SIDE + vy) * SIDE + vx].distance());
            }
        }
    }
}

fn block_points(tsdf: &Tsdf, block: &Block, padded: &[f32], voxel_m: f64) -> Vec<CloudPoint> {
    let mut points = Vec::new();
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 0..SIDE {
                let here = [x + 1, y + 1, z + 1];
                let d0 = padded[at(here[0], here[1], here[2])];
                if d0.is_nan() {
                    continue;
                }
                for axis in 0..3 {
                    let mut there = here;
                    there[axis] += 1;
                    let d1 = padded[at(there[0], there[1], there[2])];
                    // A jump of more than the truncation distance is a depth edge, not a surface.
                    if d1.is_nan() || (d0 > 0.0) == (d1 > 0.0) || (d0 - d1).abs() > 1.0 {
                        continue;
                    }
                    let fraction = d0 / (d0 - d1);
                    let Some(normal) = normal(padded, here, there, fraction) else { continue };
                    let position_m = std::array::from_fn(|i| {
                        let step = if i == axis { fraction } else { 0.0 };
                        let voxel = block.key[i] as f64 * SIDE as f64 + [x, y, z][i] as f64 + 0.5;
                        ((voxel + f64::from(step)) * voxel_m) as f32
                    });
                    let voxel = &block.voxels[(z * SIDE + y) * SIDE + x];
                    let color = match voxel.color() {
                        NO_COLOR => color_around(tsdf, block, [x, y, z], axis),
                        color => color,
                    };
                    let weight = voxel.weight();
                    points.push(CloudPoint { position_m, normal, color, label: Label::NONE, weight });
                }
            }
        }
    }
    points
}

/// Returns the colour at a sign change whose first voxel has none: that of the second, or the mean of the
/// voxels around. Only the voxels next to a reading get its colour, and the mean of several readings may be
/// a voxel away from each of them.
fn color_around(tsdf: &Tsdf, block: &Block, place: [usize; 3], axis: usize) -> [u8; 3] {
    let color = |offset: [i32; 3]| {
        let voxel = [0, 1, 2].map(|i| block.key[i] * SIDE as i32 + place[i] as i32 + offset[i]);
        let within = voxel.map(|c| c.rem_euclid(SIDE as i32) as usize);
        let block = tsdf.index.get(&voxel.map(|c| c.div_euclid(SIDE as i32)))?;
        let voxels = &tsdf.blocks[*block as usize].voxels;
        let color = Voxel::color(&voxels[(within[2] * SIDE + within[1]) * SIDE + within[0]]);
        (color != NO_COLOR).then_some(color)
    };
    let second = std::array::from_fn(|i| i32::from(i == axis));
    if let Some(color) = color(second) {
        return color;
    }
    let around = (0..27).filter_map(|step| color([step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1]));
    let (sum, count) = around.fold(([0u32; 3], 0u32), |(sum, count), color| {
        (std::array::from_fn(|i| sum[i] + u32::from(color[i])), count + 1)
    });
    // No mean of colours is `NO_COLOR`: it is rounded up.
    sum.map(|sum| sum.div_ceil(count.max(1)) as u8)
}

/// Returns the normalised gradient of the distance, from the slopes at both ends of the step.
fn normal(padded: &[f32], a: [usize; 3], b: [usize; 3], fraction: f32) -> Option<[f32; 3]> {
    let slope = |p: [usize; 3], axis: usize| -> f32 {
        let (mut before, mut after) = (p, p);
        before[axis] -= 1;
        after[axis] += 1;
        let [middle, before, after] = [p, before, after].map(|q| padded[at(q[0], q[1], q[2])]);
        // One-sided if a neighbour was never seen.
        match (before.is_nan(), after.is_nan()) {
            (false, false) => (after - before) * 0.5,
            (true, false) => after - middle,
            (false, true) => middle - before,
            (true, true) => 0.0,
        }
    };
    let g: [f32; 3] = std::array::from_fn(|i| (1.0 - fraction) * slope(a, i) + fraction * slope(b, i));
    let length = (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt();
    (length > 1e-3).then(|| g.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use super::super::cloud::{BLACK, NO_COLOR};
    use super::super::tsdf::{BLOCK_BYTES, MAX_BYTES, Tsdf};
    use viola_formats::clip::{DepthImage, Frame, FrameHeader};
    use viola_geometry::{Pinhole, Pose3};

    /// Returns the frame of a camera at the world's origin that looks along z at a wall `depth_m` away.
    fn wall(depth_m: f32) -> Frame {
        let camera = Pinhole { width: 80, height: 60, fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 };
        Frame {
            header: FrameHeader {
                number: 0,
                time_s: None,
                world_from_camera: Some(Pose3::identity()),
                force_in_camera: None,
            },
            color_camera: camera,
            color: Some(image::RgbImage::from_pixel(80, 60, image::Rgb([200, 100, 50]))),
            depth_camera: camera,
            depth: DepthImage { width: 80, height: 60, depth_m: vec![depth_m; 80 * 60] },
        }
    }

    #[test]
    fn a_wall_comes_back_where_it_is() {
        let mut tsdf = Tsdf::new(MAX_BYTES);
        tsdf.integrate(&wall(1.5), &Pose3::identity());
        tsdf.integrate(&wall(1.52), &Pose3::identity());
        let cloud = tsdf.surface();
        let inner: Vec<_> = cloud.points.iter().filter(|p| p.position_m[0].abs() < 0.5).collect();
        assert!(inner.len() > 500, "{}", inner.len());
        for point in inner {
            assert!((point.position_m[2] - 1.51).abs() < 0.002, "{point:?}");
            assert!(point.normal[2] < -0.99, "the normal faces the camera: {point:?}");
            assert_eq!(point.color, [200, 100, 50]);
        }
    }

    #[test]
    fn a_small_sensor_sees_a_far_wall_without_holes() {
        let frame = wall(4.75);
        let mut tsdf = Tsdf::new(MAX_BYTES);
        tsdf.integrate(&frame, &Pose3::identity());
        for (x, y) in (0..60u32).flat_map(|y| (0..80u32).map(move |x| (x, y))) {
            let at = frame.depth_camera.unproject(x.into(), y.into(), 4.75);
            let key = [0, 1, 2].map(|axis| (at[axis] / 0.12).floor() as i32);
            assert!(tsdf.index.contains_key(&key), "the block of pixel {x}, {y} is missing");
        }
    }

    #[test]
    fn points_have_the_colour_of_the_pictures_and_no_other() {
        let mut frame = wall(1.5);
        let (width, height) = (400, 300);
        frame.color_camera = frame.depth_camera.resized(width, height);
        let mut picture = image::RgbImage::from_fn(width, height, |x, y| {
            let is_rim = x.min(y).min(width - 1 - x).min(height - 1 - y) < 3;
            image::Rgb(if is_rim { [0; 3] } else { [200, 100, 50] })
        });
        frame.color = Some(picture.clone());
        let colors = |frame: &Frame| -> Vec<[u8; 3]> {
            let mut tsdf = Tsdf::new(MAX_BYTES);
            tsdf.integrate(frame, &Pose3::identity());
            tsdf.surface().points.iter().map(|point| point.color).collect()
        };
        let rimmed = colors(&frame);
        assert!(rimmed.len() > 1000 && rimmed.iter().all(|color| *color == [200, 100, 50]));
        // The colour camera sees a third less to each side than the depth camera.
        frame.color_camera.fx *= 1.5;
        let narrow = colors(&frame);
        let without = narrow.iter().filter(|color| **color == NO_COLOR).count();
        assert!(without * 4 > narrow.len() && without * 2 < narrow.len(), "{without} of {}", narrow.len());
        assert!(narrow.iter().all(|color| *color == NO_COLOR || *color == [200, 100, 50]));
        // A black surface has a colour.
        picture.pixels_mut().for_each(|pixel| pixel.0 = [0; 3]);
        frame.color = Some(picture);
        assert!(colors(&frame).contains(&BLACK));
    }

    #[test]
    fn memory_is_bounded() {
        let mut tsdf = Tsdf::new(10 * BLOCK_BYTES);
        tsdf.integrate(&wall(1.5), &Pose3::identity());
        assert!(tsdf.is_full());
        assert_eq!(tsdf.blocks.len(), 10);
    }
}
