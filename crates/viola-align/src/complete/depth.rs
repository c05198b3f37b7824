//! Completes the depth of a completed picture: rendered depth stays, a network's depth is fitted to it and
//! carried into the holes, and the floor keeps its known depth (paper III-D).

use super::render::{Cover, Rendering};
use image::RgbImage;
use viola_geometry::{Pinhole, Point3, Pose3};

/// Pixels of the picture along each side of a cell of the depth raster.
pub(super) const STEP: usize = 4;

/// Completed depth, coarser than its picture.
#[derive(Debug, Clone)]
pub struct CompletedDepth {
    pub camera: Pinhole,
    /// Along the camera's axis; 0 if unknown.
    pub depth_m: Vec<f32>,
    /// True for holes that were filled.
    pub filled: Vec<bool>,
}

/// One cell of the raster before completion.
#[derive(Clone, Copy)]
struct Known {
    cover: Cover,
    depth_m: f32,
    color: [f32; 3],
}

/// Fits a network's depth to the rendered one and carries it into the holes.
///
/// `estimated` has a value for each pixel of the picture that grows with the depth. `is_floor` marks the
/// pixels that a segmentation labels as floor; `clip_from_camera` has the floor at z = 0.
pub(super) fn complete(
    rendering: &Rendering,
    picture: &RgbImage,
    estimated: &[f32],
    is_floor: Option<&[bool]>,
    clip_from_camera: &Pose3,
) -> Option<CompletedDepth> {
    let (known, camera) = coarse(rendering, picture);
    let (width, height) = (camera.width as usize, camera.height as usize);
    let full = rendering.camera.width as usize;
    let middle = |i: usize| (i / width * STEP + STEP / 2) * full + i % width * STEP + STEP / 2;
    let estimated: Vec<f32> = (0..known.len()).map(|i| estimated[middle(i)]).collect();
    let fitted = fitted(&known, &estimated)?;
    let floor_m = floor_depths(&camera, clip_from_camera);
    // The fit's known errors: at the surfaces, and at recognised floor.
    let anchors: Vec<Option<f32>> = (0..known.len())
        .map(|i| match known[i].cover {
            Cover::Surface => Some(known[i].depth_m - fitted[i]),
            Cover::Hole if is_floor.is_some_and(|floor| floor[middle(i)]) => {
                floor_m[i].map(|floor_m| floor_m - fitted[i])
            }
            _ => None,
        })
        .collect();
    let errors = spread(&anchors, &known, &fitted, width, height);
    let depth_m = (0..known.len())
        .map(|i| match known[i].cover {
            Cover::Surface | Cover::Back => known[i].depth_m,
            // Nothing is seen below the floor.
            Cover::Hole => (fitted[i] + errors[i]).max(0.1).min(floor_m[i].unwrap_or(f32::INFINITY)),
        })
        .collect();
    let filled = known.iter().map(|known| known.cover == Cover::Hole).collect();
    Some(CompletedDepth { camera, depth_m, filled })
}

/// Returns the depth of the holes by known planes, without a network: the nearest of the floor and the walls.
/// `first_hit` returns the wall hit of a ray from a point, as a multiple of the ray's direction.
pub(super) fn by_planes(
    rendering: &Rendering,
    clip_from_camera: &Pose3,
    first_hit: &dyn Fn(&Point3, &viola_geometry::Vector3) -> Option<f64>,
) -> CompletedDepth {
    let (known, camera) = coarse(rendering, &rendering.color);
    let floor_m = floor_depths(&camera, clip_from_camera);
    let eye = Point3::from(clip_from_camera.translation.vector);
    let width = camera.width as usize;
    let depth_m: Vec<f32> = (0..known.len())
        .map(|i| match known[i].cover {
            Cover::Surface | Cover::Back => known[i].depth_m,
            Cover::Hole => {
                let ray = clip_from_camera.rotation * camera.ray((i % width) as f64, (i / width) as f64);
                let wall_m = first_hit(&eye, &ray).map_or(f32::INFINITY, |depth_m| depth_m as f32);
                let nearest_m = wall_m.min(floor_m[i].unwrap_or(f32::INFINITY));
                if nearest_m.is_finite() { nearest_m } else { 0.0 }
            }
        })
        .collect();
    let filled =
        known.iter().zip(&depth_m).map(|(known, d)| known.cover == Cover::Hole && *d > 0.0).collect();
    CompletedDepth { camera, depth_m, filled }
}

/// Returns the cells and their camera. A cell is a surface if at least half of its pixels are, and a hole if
/// all of them are.
fn coarse(rendering: &Rendering, picture: &RgbImage) -> (Vec<Known>, Pinhole) {
    let full = &rendering.camera;
    let camera = full.resized(full.width / STEP as u32, full.height / STEP as u32);
    let (width, height) = (camera.width as usize, camera.height as usize);
    let known = (0..width * height).map(|i| {
        let (x0, y0) = (i % width * STEP, i / width * STEP);
        let (mut surface, mut back, mut depth_m, mut color) = (0, 0, 0.0, [0.0; 3]);
        for y in y0..y0 + STEP {
            for x in x0..x0 + STEP {
                let at = y * full.width as usize + x;
                match rendering.cover[at] {
                    Cover::Surface => {
                        surface += 1;
                        depth_m += rendering.depth_m[at];
                    }
                    Cover::Back => back += 1,
                    Cover::Hole => {}
                }
                let pixel = picture.get_pixel(x as u32, y as u32).0;
                color = std::array::from_fn(|c| color[c] + f32::from(pixel[c]));
            }
        }
        let cells = (STEP * STEP) as f32;
        let cover = if 2 * surface >= STEP * STEP {
            Cover::Surface
        } else if back > 0 || surface > 0 {
            Cover::Back
        } else {
            Cover::Hole
        };
        Known {
            cover,
            depth_m: if surface > 0 { depth_m / surface as f32 } else { 0.0 },
            color: color.map(|c| c / cells),
        }
    });
    (known.collect(), camera)
}

/// Returns the estimate as depth in metres: by scale and shift of its depth, or of its inverse, whichever
/// fits the surfaces better. Networks for relative depth give the inverse up to a scale and a shift.
fn fitted(known: &[Known], estimated: &[f32]) -> Option<Vec<f32>> {
    const MIN_CELLS: usize = 50;
    const NEAREST_M: f64 = 0.1;
    let pairs: Vec<(f64, f64)> = known
        .iter()
        .zip(estimated)
        .filter(|(known, _)| known.cover == Cover::Surface && known.depth_m > 0.0)
        .map(|(known, m)| (f64::from(*m), f64::from(known.depth_m)))
        .collect();
    if pairs.len() < MIN_CELLS {
        return None;
    }
    let inverse = |m: f64| 1.0 / m.max(1e-6);
    let direct = line(&pairs);
    let inverted: Vec<(f64, f64)> = pairs.iter().map(|&(m, d)| (inverse(m), inverse(d))).collect();
    let inverted = line(&inverted);
    let by_depth = |m: f64| (direct.0 * m + direct.1).max(NEAREST_M);
    let by_inverse = |m: f64| inverse((inverted.0 * inverse(m) + inverted.1).max(0.02)).max(NEAREST_M);
    let misfit = |depth: &dyn Fn(f64) -> f64| {
        pairs.iter().map(|&(m, d)| (1.0 + ((depth(m) / d - 1.0) / ERROR).powi(2)).ln()).sum::<f64>()
    };
    let depth: &dyn Fn(f64) -> f64 =
        if misfit(&by_depth) <= misfit(&by_inverse) { &by_depth } else { &by_inverse };
    let fitted: Vec<f32> = estimated.iter().map(|m| depth(f64::from(*m)) as f32).collect();
    fitted.iter().all(|d| d.is_finite()).then_some(fitted)
}

/// Scale of the robust fit: relative error of a network's depth.
const ERROR: f64 = 0.05;

/// Returns a robust (Cauchy) line fit with positive slope from the first to the second values, by least
/// squares relative to the second. The fallback, such as for a single depth, is a line through the origin.
fn line(pairs: &[(f64, f64)]) -> (f64, f64) {
    let (mut scale, mut shift) = (0.0, 0.0);
    for round in 0..10 {
        let mut sums = [0.0; 5];
        for &(m, d) in pairs {
            let error = (scale * m + shift - d) / (ERROR * d);
            let robust = if round == 0 { 1.0 } else { 1.0 / (1.0 + error * error) };
            let weight = robust / (d * d);
            for (sum, value) in sums.iter_mut().zip([1.0, m, m * m, d, m * d]) {
                *sum += weight * value;
            }
        }
        let [n, sm, smm, sd, smd] = sums;
        let determinant = n * smm - sm * sm;
        (scale, shift) = if determinant > 1e-6 * n * smm {
            ((n * smd - sm * sd) / determinant, (smm * sd - sm * smd) / determinant)
        } else {
            (0.0, 0.0)
        };
        if scale <= 0.0 {
            (scale, shift) = (smd / smm.max(f64::MIN_POSITIVE), 0.0);
        }
    }
    (scale, shift)
}

/// Returns the floor's depth along each ray; `None` if the ray rises or the floor is too far.
fn floor_depths(camera: &Pinhole, clip_from_camera: &Pose3) -> Vec<Option<f32>> {
    const FAR_M: f64 = 12.0;
    let eye = clip_from_camera.translation.vector;
    let width = camera.width as usize;
    (0..width * camera.height as usize)
        .map(|i| {
            let ray = clip_from_camera.rotation * camera.ray((i % width) as f64, (i / width) as f64);
            let depth_m = -eye.z / ray.z;
            (ray.z < 0.0 && depth_m > 0.0 && depth_m < FAR_M).then_some(depth_m as f32)
        })
        .collect()
}

/// Spreads the anchors' values to all cells by over-relaxed sweeps in a fixed order. A cell takes the mean of
/// its neighbours, with little weight across differences in colour or jumps of the depth.
fn spread(anchors: &[Option<f32>], known: &[Known], fitted: &[f32], width: usize, height: usize) -> Vec<f32> {
    const SWEEPS: usize = 120;
    const RELAX: f32 = 1.8;
    const COLOR: f32 = 20.0;
    const JUMP: f32 = 0.05;
    let given: Vec<f32> = anchors.iter().flatten().copied().collect();
    let mean = given.iter().sum::<f32>() / given.len().max(1) as f32;
    let mut values: Vec<f32> = anchors.iter().map(|anchor| anchor.unwrap_or(mean)).collect();
    let affinity = |a: usize, b: usize| {
        let color: f32 = (0..3).map(|c| (known[a].color[c] - known[b].color[c]).powi(2)).sum();
        let jump = (fitted[a] / fitted[b]).ln() / JUMP;
        (-color / (2.0 * COLOR * COLOR) - 0.5 * jump * jump).exp().max(1e-3)
    };
    // Weights of each cell's right and lower neighbour; 0 without a neighbour.
    let cells = 0..width * height;
    let right: Vec<f32> =
        cells.clone().map(|i| if i % width + 1 < width { affinity(i, i + 1) } else { 0.0 }).collect();
    let down: Vec<f32> =
        cells.map(|i| if i / width + 1 < height { affinity(i, i + width) } else { 0.0 }).collect();
    for _ in 0..SWEEPS {
        for at in (0..width * height).filter(|at| anchors[*at].is_none()) {
            let (mut sum, mut weights) = (0.0, 0.0);
            let mut add = |other: usize, weight: f32| {
                sum += weight * values[other];
                weights += weight;
            };
            if at % width > 0 {
                add(at - 1, right[at - 1]);
            }
            if at % width + 1 < width {
                add(at + 1, right[at]);
            }
            if at >= width {
                add(at - width, down[at - width]);
            }
            if at + width < width * height {
                add(at + width, down[at]);
            }
            values[at] += RELAX * (sum / weights - values[at]);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::super::view::{View, camera_like};
    use super::*;

    const KEY: Pinhole = Pinhole { width: 512, height: 384, fx: 440.0, fy: 440.0, cx: 255.5, cy: 191.5 };

    /// Returns a rendering without the columns of `hole`, the true depth, and the pose of a camera 1.5 m
    /// above the floor that looks at a wall 3 m away, 20 degrees down.
    fn scene(hole: std::ops::Range<usize>) -> (Rendering, Vec<f32>, Pose3) {
        let camera = camera_like(&KEY);
        let view = View { eye_m: [0.0, 0.0, 1.5], yaw_rad: 0.0, pitch_rad: 20f64.to_radians() };
        let pose = view.clip_from_camera();
        let (width, height) = (camera.width as usize, camera.height as usize);
        let truth: Vec<f32> = (0..width * height)
            .map(|i| {
                let ray = pose.rotation * camera.ray((i % width) as f64, (i / width) as f64);
                let floor_m = if ray.z < 0.0 { -1.5 / ray.z } else { f64::INFINITY };
                floor_m.min(3.0 / ray.x) as f32
            })
            .collect();
        let cover: Vec<Cover> = (0..width * height)
            .map(|i| if hole.contains(&(i % width)) { Cover::Hole } else { Cover::Surface })
            .collect();
        let depth_m =
            truth.iter().zip(&cover).map(|(d, c)| if *c == Cover::Surface { *d } else { 0.0 }).collect();
        let color = RgbImage::from_pixel(camera.width, camera.height, image::Rgb([128; 3]));
        (Rendering { camera, color, depth_m, cover }, truth, pose)
    }

    /// Returns the largest error in the holes, relative to the depth.
    fn worst(completed: &CompletedDepth, truth: &[f32]) -> f32 {
        let (width, full) = (completed.camera.width as usize, 512);
        let at = |i: usize| (i / width * STEP + STEP / 2) * full + i % width * STEP + STEP / 2;
        let errors = completed.depth_m.iter().enumerate().filter(|(i, _)| completed.filled[*i]);
        errors.map(|(i, d)| (d / truth[at(i)] - 1.0).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn scale_and_shift_of_an_estimate_do_not_matter() {
        let (rendering, truth, pose) = scene(300..460);
        let depth: fn(f32) -> f32 = |d| 0.4 * d + 0.7;
        // The inverse of a relative disparity.
        let disparity: fn(f32) -> f32 = |d| 1.0 / (0.3 / d + 0.1);
        let mut completed = None;
        for change in [disparity, depth] {
            let exact: Vec<f32> = truth.iter().map(|d| change(*d)).collect();
            let filled = complete(&rendering, &rendering.color, &exact, None, &pose).unwrap();
            assert!(filled.filled.iter().filter(|f| **f).count() > 3000);
            assert!(worst(&filled, &truth) < 0.02, "{}", worst(&filled, &truth));
            completed = Some(filled);
        }
        let completed = completed.unwrap();
        // Rendered depth stays.
        for (i, d) in completed.depth_m.iter().enumerate().filter(|(i, _)| !completed.filled[*i]) {
            let at = (i / 128 * STEP + STEP / 2) * 512 + i % 128 * STEP + STEP / 2;
            assert!((d / truth[at] - 1.0).abs() < 0.05);
        }
    }

    #[test]
    fn a_bent_estimate_is_pulled_straight() {
        let (rendering, truth, pose) = scene(300..420);
        // The error grows to the right: at the hole it is a quarter of a metre and more.
        let bent: Vec<f32> = truth.iter().enumerate().map(|(i, d)| d + 0.001 * (i % 512) as f32).collect();
        let completed = complete(&rendering, &rendering.color, &bent, None, &pose).unwrap();
        assert!(worst(&completed, &truth) < 0.05, "{}", worst(&completed, &truth));
    }

    #[test]
    fn nothing_is_below_the_floor() {
        let (rendering, truth, pose) = scene(300..460);
        let far: Vec<f32> = truth
            .iter()
            .enumerate()
            .map(|(i, d)| if (300..460).contains(&(i % 512)) { 2.0 * d } else { *d })
            .collect();
        let completed = complete(&rendering, &rendering.color, &far, None, &pose).unwrap();
        let eye = Point3::new(0.0, 0.0, 1.5);
        for (i, d) in completed.depth_m.iter().enumerate() {
            let ray = completed.camera.ray((i % 128) as f64, (i / 128) as f64);
            let at = eye + pose.rotation * ray * f64::from(*d);
            assert!(at.z > -0.05, "{at}");
        }
        // If the floor is recognised, the rest follows it.
        let camera = completed.camera;
        let is_floor: Vec<bool> = (0..truth.len())
            .map(|i| {
                let (u, v) = (i % 512 / STEP, i / 512 / STEP);
                let ray = pose.rotation * camera.ray(u as f64, v as f64);
                (eye + ray * f64::from(truth[i])).z < 0.01
            })
            .collect();
        let pulled = complete(&rendering, &rendering.color, &far, Some(&is_floor), &pose).unwrap();
        assert!(worst(&pulled, &truth) < worst(&completed, &truth));
    }

    #[test]
    fn planes_do_where_there_is_no_network() {
        let (rendering, truth, pose) = scene(300..460);
        let wall = |eye: &Point3, ray: &viola_geometry::Vector3| Some((3.0 - eye.x) / ray.x);
        let completed = by_planes(&rendering, &pose, &wall);
        assert!(worst(&completed, &truth) < 0.02);
    }

    #[test]
    fn without_surface_there_is_nothing_to_fit() {
        let (rendering, truth, pose) = scene(0..512);
        assert!(complete(&rendering, &rendering.color, &truth, None, &pose).is_none());
    }
}
