//! The colours of a mesh as a picture, for readers that ignore colours of vertices.

use super::Mesh;
use crate::png::png;
use image::{Rgb, RgbImage};

/// Texels along the side of a triangle's block: one for each corner, and one across from the first corner.
const BLOCK: u32 = 2;

/// A square picture with a block of texels for each triangle. No two triangles share a texel, and a block holds all colours
/// of its triangle by bilinear interpolation.
pub struct Texture {
    blocks_in_row: u32,
}

impl Texture {
    pub fn new(triangles: usize) -> Texture {
        Texture { blocks_in_row: ((triangles as f64).sqrt().ceil() as u32).max(1) }
    }

    fn size_px(&self) -> u32 {
        BLOCK * self.blocks_in_row
    }

    /// Returns the first column and row of a triangle's block.
    fn block(&self, triangle: usize) -> [u32; 2] {
        let triangle = triangle as u32;
        [BLOCK * (triangle % self.blocks_in_row), BLOCK * (triangle / self.blocks_in_row)]
    }

    /// Returns the places of a triangle's corners in the picture, 0 to 1 from its lower left: centres of texels.
    pub fn corners(&self, triangle: usize) -> [[f32; 2]; 3] {
        let [column, row] = self.block(triangle);
        let size_px = self.size_px() as f32;
        [[column, row], [column + 1, row], [column, row + 1]]
            .map(|[column, row]| [(column as f32 + 0.5) / size_px, 1.0 - (row as f32 + 0.5) / size_px])
    }

    /// Returns the picture as PNG, with sRGB values.
    pub fn png(&self, mesh: &Mesh) -> Vec<u8> {
        let mut picture = RgbImage::new(self.size_px(), self.size_px());
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|vertex| mesh.vertices[vertex as usize].color);
            let [column, row] = self.block(index);
            picture.put_pixel(column, row, Rgb(a));
            picture.put_pixel(column + 1, row, Rgb(b));
            picture.put_pixel(column, row + 1, Rgb(c));
            // With the fourth corner of the parallelogram, bilinear interpolation is linear in the triangle.
            let across = |channel: usize| {
                let [a, b, c] = [a, b, c].map(|color| i16::from(color[channel]));
                (b + c - a).clamp(0, i16::from(u8::MAX)) as u8
            };
            picture.put_pixel(column + 1, row + 1, Rgb(std::array::from_fn(across)));
        }
        png(&picture)
    }
}
