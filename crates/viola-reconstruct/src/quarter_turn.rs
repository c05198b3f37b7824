//! Quarter turns that set a picture upright: phones record sideways, and networks know rooms upright.

use image::{RgbImage, imageops};
use viola_geometry::Vector3;

/// Minimum length of the up direction in the picture plane, as a fraction. A camera that looks further down or up
/// has no upright picture.
const MIN_UPRIGHT: f64 = 0.35;

/// A clockwise turn of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QuarterTurn {
    None,
    Right,
    Half,
    Left,
}

impl QuarterTurn {
    /// Returns the turn that sets a picture upright, by the unit up direction in the camera's axes (x right, y down, z
    /// forward).
    pub fn upright(up_in_camera: &Vector3) -> QuarterTurn {
        let up = up_in_camera.xy();
        if up.norm() <= MIN_UPRIGHT {
            QuarterTurn::None
        } else if up.y.abs() >= up.x.abs() {
            if up.y < 0.0 { QuarterTurn::None } else { QuarterTurn::Half }
        } else if up.x > 0.0 {
            QuarterTurn::Left
        } else {
            QuarterTurn::Right
        }
    }

    /// Turns a picture.
    pub fn of_picture(self, picture: &RgbImage) -> RgbImage {
        match self {
            QuarterTurn::None => picture.clone(),
            QuarterTurn::Right => imageops::rotate90(picture),
            QuarterTurn::Half => imageops::rotate180(picture),
            QuarterTurn::Left => imageops::rotate270(picture),
        }
    }

    /// Returns the place of a pixel in the turned picture. Pixel centres have integer coordinates.
    pub fn of_pixel(self, [u, v]: [f32; 2], [width, height]: [u32; 2]) -> [f32; 2] {
        let (right, bottom) = (width as f32 - 1.0, height as f32 - 1.0);
        match self {
            QuarterTurn::None => [u, v],
            QuarterTurn::Right => [bottom - v, u],
            QuarterTurn::Half => [right - u, bottom - v],
            QuarterTurn::Left => [v, right - u],
        }
    }

    /// Returns the size of the turned picture.
    pub fn of_size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        match self {
            QuarterTurn::None | QuarterTurn::Half => [width, height],
            QuarterTurn::Right | QuarterTurn::Left => [height, width],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// The up direction of the camera is up in the turned picture, and pixels go where the turn puts them.
    #[test]
    fn the_turned_picture_is_upright() {
        let size = [5u32, 3];
        let picture = RgbImage::from_fn(size[0], size[1], |x, y| Rgb([x as u8, y as u8, 0]));
        for (up, expected) in [
            ([0.1, -0.9, 0.4], QuarterTurn::None),
            ([0.9, 0.1, 0.4], QuarterTurn::Left),
            ([-0.9, 0.1, 0.4], QuarterTurn::Right),
            ([0.1, 0.9, 0.4], QuarterTurn::Half),
            ([0.3, 0.0, 0.95], QuarterTurn::None),
        ] {
            let up = Vector3::from(up).normalize();
            let turn = QuarterTurn::upright(&up);
            assert_eq!(turn, expected);
            let turned = turn.of_picture(&picture);
            assert_eq!([turned.width(), turned.height()], turn.of_size(size));
            for (x, y, pixel) in picture.enumerate_pixels() {
                let [u, v] = turn.of_pixel([x as f32, y as f32], size);
                assert_eq!(turned.get_pixel(u as u32, v as u32), pixel);
            }
            if up.xy().norm() > MIN_UPRIGHT {
                let from = turn.of_pixel([2.0, 1.0], size);
                let to = turn.of_pixel([2.0 + up.x as f32, 1.0 + up.y as f32], size);
                assert!(to[1] - from[1] < -0.5, "{up:?}");
            }
        }
    }
}
