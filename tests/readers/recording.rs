//! A recording without a layout: the input of every writer of a layout.

use crate::writers::{color_jpeg, pose, units};
use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion};
use std::path::Path;

pub struct Recorded {
    pub number: u32,
    pub time_s: f64,
    pub jpeg: Vec<u8>,
    /// Row after row; 0 where there is no reading.
    pub depth_mm: Vec<u16>,
    /// World with z up, camera with OpenCV's axes.
    pub world_from_camera: Matrix4<f64>,
}

pub struct Recording {
    pub frames: Vec<Recorded>,
    pub color_size: (u32, u32),
    pub depth_size: (u32, u32),
    /// fx, fy, cx, cy in pixels of the depth picture.
    pub depth_k: [f64; 4],
    /// Readings that the device does not trust, in every frame.
    pub doubtful: Vec<(u32, u32)>,
}

impl Recording {
    /// Returns a few small frames without round numbers.
    pub fn small(frames: u32) -> Recording {
        let depth_size = (32, 24);
        let frame = |number: u32| Recorded {
            number,
            time_s: 5000.25 + 0.1 * f64::from(number),
            jpeg: color_jpeg(64, 48),
            depth_mm: (0..24 * 32)
                .map(|i| match units(number, i % 32, i / 32) {
                    u16::MAX => 0,
                    mm => mm,
                })
                .collect(),
            world_from_camera: Matrix4::from_fn(|row, column| pose(number)[row][column]),
        };
        Recording {
            frames: (0..frames).map(frame).collect(),
            color_size: (64, 48),
            depth_size,
            depth_k: [28.25, 28.5, 15.75, 11.25],
            doubtful: vec![(7, 5), (31, 23)],
        }
    }

    /// Reads some frames of a recording in ScanNet's layout.
    pub fn scannet(folder: &Path, numbers: std::ops::Range<u32>) -> Recording {
        let matrix = |name: String| -> Matrix4<f64> {
            let text = std::fs::read_to_string(folder.join(name)).unwrap();
            Matrix4::from_row_iterator(text.split_whitespace().map(|word| word.parse().unwrap()))
        };
        let k = matrix("intrinsic/intrinsic_depth.txt".into());
        let mut sizes = ((0, 0), (0, 0));
        let mut frames = Vec::new();
        for number in numbers {
            let jpeg = std::fs::read(folder.join(format!("color/{number}.jpg"))).unwrap();
            let depth = image::open(folder.join(format!("depth/{number}.png"))).unwrap().into_luma16();
            sizes.0 = image::load_from_memory(&jpeg).unwrap().into_rgb8().dimensions();
            sizes.1 = depth.dimensions();
            frames.push(Recorded {
                number: frames.len() as u32,
                time_s: 77.5 + 0.1 * frames.len() as f64,
                jpeg,
                depth_mm: depth.into_raw(),
                world_from_camera: matrix(format!("pose/{number}.txt")),
            });
        }
        let depth_k = [k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]];
        Recording { frames, color_size: sizes.0, depth_size: sizes.1, depth_k, doubtful: Vec::new() }
    }

    /// Returns the intrinsics in pixels of a picture of another size with the same view.
    pub fn k_of(&self, size: (u32, u32)) -> [f64; 4] {
        let [fx, fy, cx, cy] = self.depth_k;
        let sx = f64::from(size.0) / f64::from(self.depth_size.0);
        let sy = f64::from(size.1) / f64::from(self.depth_size.1);
        [fx * sx, fy * sy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5]
    }

    /// Returns the intrinsics in pixels of the colour picture.
    pub fn color_k(&self) -> [f64; 4] {
        self.k_of(self.color_size)
    }

    pub fn depth_png(&self, frame: &Recorded) -> Vec<u8> {
        let (width, height) = self.depth_size;
        crate::writers::depth_png(width, height, |x, y| frame.depth_mm[(y * width + x) as usize])
    }

    /// Returns the confidence row after row, `best` for trusted readings.
    pub fn confidence(&self, best: u8) -> Vec<u8> {
        let (width, height) = self.depth_size;
        let mut values = vec![best; (width * height) as usize];
        for (x, y) in &self.doubtful {
            values[(y * width + x) as usize] = 0;
        }
        values
    }

    pub fn confidence_png(&self, best: u8) -> Vec<u8> {
        let (width, height) = self.depth_size;
        let image = image::GrayImage::from_raw(width, height, self.confidence(best)).unwrap();
        crate::writers::encode(&image.into(), image::ImageFormat::Png)
    }
}

/// Converts to ARKit's world, with y up: x stays, z up becomes y up.
pub fn y_up(world_from_camera: &Matrix4<f64>) -> Matrix4<f64> {
    let turn = Matrix4::new(1., 0., 0., 0., 0., 0., 1., 0., 0., -1., 0., 0., 0., 0., 0., 1.);
    turn * world_from_camera
}

/// Converts to OpenGL's camera, which looks along -z and has y up.
pub fn gl(world_from_camera: &Matrix4<f64>) -> Matrix4<f64> {
    world_from_camera * Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0, -1.0, -1.0, 1.0))
}

/// Returns the rotation as x y z w.
pub fn quaternion(matrix: &Matrix4<f64>) -> [f64; 4] {
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into();
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    [q.i, q.j, q.k, q.w]
}

/// Returns the elements row after row.
pub fn rows(matrix: &Matrix4<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}
