//! Converts completed depth to points without outliers.

use super::depth::CompletedDepth;
use image::RgbImage;
use rustc_hash::FxHashMap;
use viola_geometry::{Point3, Pose3};
use viola_reconstruct::cloud::BLACK;
use viola_reconstruct::{CloudPoint, NO_COLOR};

/// Returns the filled cells of a completed depth as points in the clip frame. A cell on a jump of the depth
/// belongs to neither side and is left out.
pub(super) fn points(
    depth: &CompletedDepth,
    picture: &RgbImage,
    clip_from_camera: &Pose3,
) -> Vec<CloudPoint> {
    const JUMP: f32 = 0.06;
    const FAR_M: f32 = 8.0;
    let (width, height) = (depth.camera.width as usize, depth.camera.height as usize);
    let step = picture.width() as usize / width;
    let at = |x: usize, y: usize| {
        depth.camera.unproject(x as f64, y as f64, f64::from(depth.depth_m[y * width + x]))
    };
    let mut points = Vec::new();
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let i = y * width + x;
            let here_m = depth.depth_m[i];
            let around = [i - 1, i + 1, i - width, i + width].map(|j| depth.depth_m[j]);
            let smooth = |d: f32| d > 0.0 && (d / here_m - 1.0).abs() < JUMP;
            if !depth.filled[i] || here_m <= 0.0 || here_m > FAR_M || !around.into_iter().all(smooth) {
                continue;
            }
            let slope = (at(x + 1, y) - at(x - 1, y)).cross(&(at(x, y + 1) - at(x, y - 1)));
            let Some(normal) = slope.try_normalize(1e-12) else { continue };
            // Towards the camera, which is at the origin of its frame.
            let normal = if normal.dot(&at(x, y).coords) > 0.0 { -normal } else { normal };
            let (position, normal) = (clip_from_camera * at(x, y), clip_from_camera * normal);
            let [u, v] = [x, y].map(|at| (at * step + step / 2) as u32);
            let color = match picture.get_pixel(u, v).0 {
                NO_COLOR => BLACK,
                color => color,
            };
            points.push(CloudPoint {
                color,
                ..CloudPoint::new(position.map(|c| c as f32).into(), normal.map(|c| c as f32).into())
            });
        }
    }
    points
}

/// Drops the points whose neighbours are unusually far: the mean distance to them is more than two standard
/// deviations above the mean of all (Rusu et al., 2008). Points of `observed` count as neighbours.
pub(super) fn without_outliers(
    points: Vec<CloudPoint>,
    observed: &[CloudPoint],
    voxel_m: f64,
) -> Vec<CloudPoint> {
    const NEIGHBOURS: usize = 8;
    let side_m = 3.0 * voxel_m;
    let cell = |p: &Point3| [p.x, p.y, p.z].map(|c| (c / side_m).floor() as i32);
    let mut cells: FxHashMap<[i32; 3], Vec<Point3>> = FxHashMap::default();
    for point in points.iter().chain(observed) {
        let near = cells.entry(cell(&point.position())).or_default();
        // A cell with this many points is dense; further points do not matter.
        if near.len() < 4 * NEIGHBOURS {
            near.push(point.position());
        }
    }
    let spacing = |point: &CloudPoint| {
        let at = point.position();
        let [x, y, z] = cell(&at);
        let around = (0..27).map(|i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        let mut gaps: Vec<f64> = around
            .filter_map(|key| cells.get(&key))
            .flatten()
            .map(|p| (p - at).norm())
            .filter(|gap| *gap > 1e-9)
            .collect();
        gaps.sort_by(f64::total_cmp);
        gaps.truncate(NEIGHBOURS);
        // A missing neighbour counts as further than the cells reach.
        let missing = (NEIGHBOURS - gaps.len()) as f64 * 2.0 * side_m;
        (gaps.iter().sum::<f64>() + missing) / NEIGHBOURS as f64
    };
    let spacings: Vec<f64> = points.iter().map(spacing).collect();
    let count = spacings.len().max(1) as f64;
    let mean = spacings.iter().sum::<f64>() / count;
    let deviation = (spacings.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / count).sqrt();
    let bar = mean + 2.0 * deviation;
    points.into_iter().zip(spacings).filter(|(_, spacing)| *spacing <= bar).map(|(point, _)| point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::Pinhole;

    /// Without a colour, the next view would paint them again.
    #[test]
    fn points_of_a_black_picture_have_a_colour() {
        let camera = Pinhole { width: 8, height: 6, fx: 7.0, fy: 7.0, cx: 3.5, cy: 2.5 };
        let depth = CompletedDepth { camera, depth_m: vec![2.0; 48], filled: vec![true; 48] };
        let points = points(&depth, &RgbImage::new(32, 24), &Pose3::identity());
        assert!(points.len() == 24 && points.iter().all(|point| point.color == BLACK), "{points:?}");
    }

    fn point(x: f32, y: f32, z: f32) -> CloudPoint {
        CloudPoint::new([x, y, z], [0.0, 0.0, 1.0])
    }

    #[test]
    fn what_stands_alone_is_dropped() {
        let sheet = (0..400).map(|i| point((i % 20) as f32 * 0.03, (i / 20) as f32 * 0.03, 0.0));
        let mut points: Vec<CloudPoint> = sheet.collect();
        points.push(point(0.3, 0.3, 1.0));
        points.push(point(2.0, 0.3, 0.0));
        let kept = without_outliers(points.clone(), &[], 0.03);
        assert!(kept.len() >= 390 && kept.iter().all(|p| p.position_m[0] < 0.6 && p.position_m[2] < 0.1));
        // Points beside observed ones are no outliers.
        let observed: Vec<CloudPoint> = (0..100)
            .map(|i| point(2.0 + (i % 10) as f32 * 0.02, 0.3 + (i / 10) as f32 * 0.02 - 0.1, 0.0))
            .collect();
        let kept = without_outliers(points, &observed, 0.03);
        assert!(kept.iter().any(|p| p.position_m[0] == 2.0));
    }
}
