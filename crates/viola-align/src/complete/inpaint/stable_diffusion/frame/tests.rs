use super::*;
use image::{Luma, Rgb};
use viola_network::manifest::{Manifest, ModelEntry};

const NETWORK: Raster = Raster { width: 64, height: 32 };
const CELL: usize = 8;

fn rule() -> Input {
    let manifest = Manifest::built_in().unwrap();
    manifest.find("stable-diffusion-inpainting").and_then(|entry: &ModelEntry| entry.input.clone()).unwrap()
}

fn frame(picture: &RgbImage, hole: &GrayImage) -> Frame {
    Frame::new(picture, hole, &rule(), NETWORK, CELL)
}

fn drawn(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| Rgb([x as u8 * 3, y as u8 * 5, (x * y) as u8]))
}

#[test]
fn a_picture_of_the_networks_size_goes_in_and_out_unchanged() {
    let picture = drawn(64, 32);
    let frame = frame(&picture, &GrayImage::new(64, 32));
    let values = frame.masked.as_f32().unwrap();
    assert!(values.iter().all(|v| (-1.0..=1.0).contains(v)));
    assert_eq!(frame.picture(values), Ok(picture));
    assert!(frame.mask.iter().all(|m| *m == 0.0));
}

#[test]
fn holes_are_empty_and_told_by_the_corner_of_a_cell() {
    // One pixel beside a corner, and one in it.
    let mut hole = GrayImage::new(64, 32);
    hole.put_pixel(9, 8, Luma([255]));
    hole.put_pixel(24, 16, Luma([255]));
    let frame = frame(&drawn(64, 32), &hole);
    let values = frame.masked.as_f32().unwrap();
    for c in 0..3 {
        assert_eq!(values[c * 64 * 32 + 8 * 64 + 9], 0.0);
        assert_eq!(values[c * 64 * 32 + 16 * 64 + 24], 0.0);
    }
    let cells: Vec<usize> = (0..frame.mask.len()).filter(|at| frame.mask[*at] == 1.0).collect();
    assert_eq!(cells, [2 * 8 + 3]);
}

#[test]
fn what_is_left_over_repeats_the_edge() {
    // Half as wide as the network's input: the right half is padding.
    let frame = frame(&drawn(20, 20), &GrayImage::new(20, 20));
    let values = frame.masked.as_f32().unwrap();
    for row in values.chunks_exact(64) {
        assert!(row[32..].iter().all(|v| *v == row[31]));
    }
    assert_eq!(frame.picture(values).unwrap().dimensions(), (20, 20));
}

/// A pixel of the small picture is in a hole if one of its source pixels is.
#[test]
fn no_hole_is_lost_in_a_smaller_picture() {
    for (x, y) in [(0, 0), (639, 319), (317, 111), (5, 200)] {
        let mut hole = GrayImage::new(640, 320);
        hole.put_pixel(x, y, Luma([255]));
        let fit = Fit::into_fixed(Raster { width: 640, height: 320 }, NETWORK, None, false);
        let holes = holes(&hole, fit);
        let places: Vec<usize> = (0..holes.len()).filter(|at| holes[*at]).collect();
        assert_eq!(places, [y as usize / 10 * 64 + x as usize / 10]);
    }
}
