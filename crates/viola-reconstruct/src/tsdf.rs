//! A truncated signed distance map on sparse voxel blocks (paper III-A; Curless and Levoy, 1996).

use super::cloud::{BLACK, NO_COLOR, PointCloud};
use super::extract;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_formats::clip::Frame;
use viola_geometry::{Pinhole, Point3, Pose3};

/// Truncation distance: several times the depth noise, less than the thickness of a wall.
const TRUNCATION_M: f64 = 0.10;
/// Readings outside this range are ignored: too noisy, or the housing of the device.
pub(crate) const MIN_DEPTH_M: f32 = 0.15;
pub(crate) const MAX_DEPTH_M: f32 = 5.0;

/// Width of a picture's rim, as a fraction of its side. Programs that remove the lens's distortion leave black
/// there, some pixels wide, which compression smears.
const RIM: f32 = 0.01;
/// Darker pixels of the rim are no colour.
const RIM_DARKNESS: u8 = 40;

/// Voxels along the side of a block.
pub(super) const SIDE: usize = 4;
pub(super) const VOXELS: usize = SIDE * SIDE * SIDE;

const VOXEL_M: f64 = 0.03;
const BLOCK_M: f64 = VOXEL_M * SIDE as f64;
/// Maximum number of pixels from one ray that creates blocks to the next.
const MAX_STRIDE: usize = 3;
/// Maximum memory of a clip's blocks. A flat of 150 m2 has about 180 000 blocks, 100 MiB.
pub(super) const MAX_BYTES: usize = 192 << 20;

/// One cell: eight bytes, because there are millions.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Voxel {
    /// Distance to the surface in units of truncation / 32767, positive on the seen side.
    distance: i16,
    /// Sum of the readings' weights, saturating; 0 if never seen.
    weight: u16,
    /// [`NO_COLOR`] until a picture shows the voxel.
    color: [u8; 3],
    /// Readings in `color`, saturating. Still 0 with a colour from the rim of a picture.
    color_count: u8,
}

impl Voxel {
    /// Returns the distance in units of truncation; NaN if never seen.
    pub(super) fn distance(&self) -> f32 {
        if self.weight == 0 { f32::NAN } else { f32::from(self.distance) / 32767.0 }
    }

    pub(super) fn color(&self) -> [u8; 3] {
        self.color
    }

    /// Returns the sum of its readings' weights.
    pub(super) fn weight(&self) -> u16 {
        self.weight
    }

    fn add_distance(&mut self, distance: f32, weight: u16) {
        let (old, new) = (f32::from(self.weight), f32::from(weight));
        let mean = (f32::from(self.distance) * old + distance * 32767.0 * new) / (old + new);
        self.distance = mean.round().clamp(-32767.0, 32767.0) as i16;
        // A bounded weight lets the map follow a changed scene and keeps the sum from overflowing.
        self.weight = self.weight.saturating_add(weight).min(16_384);
    }

    /// Adds a colour to the mean. `noise` rounds the mean: to the nearest, it would not follow a reading that differs by
    /// less than half the count.
    fn add_color(&mut self, color: [u8; 3], noise: u32) {
        let count = u32::from(self.color_count);
        for (channel, (mean, value)) in self.color.iter_mut().zip(color).enumerate() {
            let sum = u32::from(*mean) * count + u32::from(value);
            let dither = (noise >> (10 * channel)) % (count + 1);
            *mean = ((sum + dither) / (count + 1)) as u8;
        }
        if self.color == NO_COLOR {
            self.color = BLACK;
        }
        self.color_count = (self.color_count + 1).min(32);
    }

    /// Sets a colour from the rim of a picture if there is none; the first other one replaces it.
    fn add_rim_color(&mut self, color: [u8; 3]) {
        let is_dark = color.iter().all(|value| *value <= RIM_DARKNESS);
        if self.color == NO_COLOR && !is_dark {
            self.color = color;
        }
    }
}

/// Four voxels a side, z slowest.
pub(super) struct Block {
    pub(super) key: [i32; 3],
    /// The last frame that touched the block.
    stamp: u32,
    pub(super) voxels: Box<[Voxel; VOXELS]>,
}

/// Memory of a block with its entry in the index, whose table is at least half full.
pub(super) const BLOCK_BYTES: usize =
    size_of::<Block>() + VOXELS * size_of::<Voxel>() + 2 * (size_of::<[i32; 3]>() + size_of::<u32>() + 1);

/// The map. Voxel `(0, 0, 0)` of block `(0, 0, 0)` has its centre half a voxel from the world's origin.
pub struct Tsdf {
    max_bytes: usize,
    pub(super) blocks: Vec<Block>,
    pub(super) index: FxHashMap<[i32; 3], u32>,
    frames: u32,
    full: bool,
}

impl Tsdf {
    /// Returns an empty map. Surface beyond `max_bytes` of blocks is left out.
    pub fn new(max_bytes: usize) -> Tsdf {
        Tsdf { max_bytes, blocks: Vec::new(), index: FxHashMap::default(), frames: 0, full: false }
    }

    /// Returns whether surface was left out because of `max_bytes`.
    pub fn is_full(&self) -> bool {
        self.full
    }

    /// Fuses one frame. The result depends on the order of the frames, not on threads.
    pub fn integrate(&mut self, frame: &Frame, world_from_camera: &Pose3) {
        self.frames += 1;
        self.allocate(frame, world_from_camera);
        let stamp = self.frames;
        let update = Update::new(frame, world_from_camera, stamp);
        self.blocks.par_iter_mut().with_min_len(64).for_each(|block| {
            if block.stamp == stamp {
                update.block(block);
            }
        });
    }

    /// Returns the surface as points in the world frame.
    pub fn surface(&self) -> PointCloud {
        PointCloud { points: extract::surface_points(self, VOXEL_M), voxel_m: VOXEL_M }
    }

    /// Creates and stamps the blocks around the readings.
    fn allocate(&mut self, frame: &Frame, world_from_camera: &Pose3) {
        let stride = stride(&frame.depth_camera);
        let reach_m = TRUNCATION_M;
        let origin = world_from_camera.translation.vector;
        // By sample: a ray's samples are mostly in the blocks of those of the ray beside it.
        let mut last = [None; 3];
        for y in (0..frame.depth.height).step_by(stride) {
            for x in (0..frame.depth.width).step_by(stride) {
                let depth_m = frame.depth.at(x, y);
                if !(MIN_DEPTH_M..=MAX_DEPTH_M).contains(&depth_m) {
                    continue;
                }
                let ray = world_from_camera.rotation * frame.depth_camera.ray(f64::from(x), f64::from(y));
                let depth_m = f64::from(depth_m);
                // The samples of a ray, and the rays beside it, are at most a block apart, so a block that they miss
                // has little of the truncation band.
                for (along, last) in [-reach_m, 0.0, reach_m].into_iter().zip(&mut last) {
                    let point = origin + ray * (depth_m + along / ray.norm());
                    let key = [0, 1, 2].map(|axis| (point[axis] / BLOCK_M).floor() as i32);
                    if *last != Some(key) {
                        *last = Some(key);
                        self.touch(key);
                    }
                }
            }
        }
    }

    fn touch(&mut self, key: [i32; 3]) {
        let next = self.blocks.len();
        if let Some(&at) = self.index.get(&key) {
            self.blocks[at as usize].stamp = self.frames;
        } else if (next + 1) * BLOCK_BYTES <= self.max_bytes {
            self.index.insert(key, next as u32);
            self.blocks.push(Block { key, stamp: self.frames, voxels: Box::new([Voxel::default(); VOXELS]) });
        } else {
            self.full = true;
        }
    }
}

/// Returns the number of pixels from one ray that creates blocks to the next: at the maximum depth they are at most a block
/// apart, if one pixel is not more.
fn stride(camera: &Pinhole) -> usize {
    let block_pixels = BLOCK_M * camera.fx.min(camera.fy) / f64::from(MAX_DEPTH_M);
    (block_pixels as usize).clamp(1, MAX_STRIDE)
}

/// Returns the bits that round the colours of a voxel in a frame: they depend on neither threads nor blocks.
fn noise(stamp: u32, point: &nalgebra::Vector3<f32>) -> u32 {
    let mixed = point.iter().fold(stamp, |mixed, value| (mixed ^ value.to_bits()).wrapping_mul(0x9e37_79b1));
    mixed ^ (mixed >> 15)
}

/// The update of a block by one frame.
struct Update<'a> {
    frame: &'a Frame,
    camera_from_world: Pose3,
    /// Number of the frame.
    stamp: u32,
    /// Camera-frame steps of one voxel along the world's axes.
    steps: [nalgebra::Vector3<f32>; 3],
}

impl<'a> Update<'a> {
    fn new(frame: &'a Frame, world_from_camera: &Pose3, stamp: u32) -> Update<'a> {
        let camera_from_world = world_from_camera.inverse();
        let steps = [nalgebra::Vector3::x(), nalgebra::Vector3::y(), nalgebra::Vector3::z()]
            .map(|axis| (camera_from_world.rotation * (axis * VOXEL_M)).cast::<f32>());
        Update { frame, camera_from_world, stamp, steps }
    }

    fn block(&self, block: &mut Block) {
        let first = Point3::from(nalgebra::Vector3::from_fn(|axis, _| {
            (f64::from(block.key[axis]) * SIDE as f64 + 0.5) * VOXEL_M
        }));
        let first = (self.camera_from_world * first).coords.cast::<f32>();
        for z in 0..SIDE {
            for y in 0..SIDE {
                let mut point = first + self.steps[2] * z as f32 + self.steps[1] * y as f32;
                let row = (z * SIDE + y) * SIDE;
                for voxel in &mut block.voxels[row..row + SIDE] {
                    self.voxel(voxel, &point);
                    point += self.steps[0];
                }
            }
        }
    }

    fn voxel(&self, voxel: &mut Voxel, point: &nalgebra::Vector3<f32>) {
        let camera = &self.frame.depth_camera;
        if point.z < MIN_DEPTH_M {
            return;
        }
        let inverse_z = 1.0 / point.z;
        let u = camera.fx as f32 * point.x * inverse_z + camera.cx as f32 + 0.5;
        let v = camera.fy as f32 * point.y * inverse_z + camera.cy as f32 + 0.5;
        if u < 0.0 || v < 0.0 || u >= camera.width as f32 || v >= camera.height as f32 {
            return;
        }
        let depth_m = self.frame.depth.at(u as u32, v as u32);
        if !(MIN_DEPTH_M..=MAX_DEPTH_M).contains(&depth_m) {
            return;
        }
        let distance = (depth_m - point.z) / TRUNCATION_M as f32;
        if distance < -1.0 {
            return;
        }
        // Depth noise of these sensors grows with the square of the range.
        let weight = (256.0 / (depth_m * depth_m)).clamp(8.0, 512.0) as u16;
        voxel.add_distance(distance.min(1.0), weight);
        if distance.abs() < 0.5 {
            self.color(voxel, point, inverse_z);
        }
    }

    fn color(&self, voxel: &mut Voxel, point: &nalgebra::Vector3<f32>, inverse_z: f32) {
        let Some(picture) = &self.frame.color else { return };
        let camera = &self.frame.color_camera;
        let u = camera.fx as f32 * point.x * inverse_z + camera.cx as f32 + 0.5;
        let v = camera.fy as f32 * point.y * inverse_z + camera.cy as f32 + 0.5;
        let (width, height) = (camera.width as f32, camera.height as f32);
        if u < 0.0 || v < 0.0 || u >= width || v >= height {
            return;
        }
        let color = picture.get_pixel(u as u32, v as u32).0;
        let is_within = |at: f32, side: f32| at >= RIM * side && at < (1.0 - RIM) * side;
        if is_within(u, width) && is_within(v, height) {
            voxel.add_color(color, noise(self.stamp, point));
        } else {
            voxel.add_rim_color(color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding to the nearest would keep a mean of 32 readings that differ from later ones by less than 16.
    #[test]
    fn a_colour_follows_the_light() {
        let mut voxel = Voxel::default();
        let mut add = |value: u8, readings: std::ops::Range<u32>| {
            let point = nalgebra::Vector3::new(0.1, 0.2, 1.5);
            readings.for_each(|stamp| voxel.add_color([value, value, 0], noise(stamp, &point)));
            voxel.color()
        };
        assert_eq!(add(100, 0..40), [100, 100, 0]);
        let [red, green, blue] = add(110, 40..400);
        assert!(red.abs_diff(110) <= 1 && green.abs_diff(110) <= 1 && blue == 0, "{red} {green} {blue}");
    }

    #[test]
    fn rays_are_at_most_a_block_apart() {
        for (focal, pixels) in [(577.6, 3), (193.1, 3), (126.0, 3), (100.0, 2), (70.0, 1), (8.0, 1)] {
            let camera = Pinhole { width: 80, height: 60, fx: focal, fy: focal, cx: 39.5, cy: 29.5 };
            assert_eq!(stride(&camera), pixels, "{focal}");
        }
    }
}
