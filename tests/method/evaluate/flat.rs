//! A small flat as a map, in which no two places look alike.

use std::path::{Path, PathBuf};

const WIDTH: usize = 140;
const HEIGHT: usize = 110;

/// Walls as boxes of 5 cm cells: left, bottom, right, top, ends included; y runs up.
const WALLS: &[[usize; 4]] = &[
    // around it
    [5, 5, 134, 6],
    [5, 103, 134, 104],
    [5, 5, 6, 104],
    [133, 5, 134, 104],
    // between the rooms, with doors
    [70, 5, 71, 40],
    [70, 58, 71, 104],
    [71, 66, 110, 67],
    // a cupboard, a chimney, a bay
    [7, 88, 30, 103],
    [50, 7, 62, 15],
    [118, 7, 132, 22],
    [90, 96, 100, 103],
    [7, 40, 14, 44],
];

/// Writes the flat as a ROS map and returns the path of its yaml.
pub fn write(folder: &Path) -> PathBuf {
    let mut pixels = vec![205u8; WIDTH * HEIGHT];
    let mut fill = |[left, bottom, right, top]: [usize; 4], value: u8| {
        for y in bottom..=top {
            for x in left..=right {
                pixels[(HEIGHT - 1 - y) * WIDTH + x] = value;
            }
        }
    };
    fill([5, 5, 134, 104], 254);
    WALLS.iter().for_each(|wall| fill(*wall, 0));
    let mut pgm = format!("P5\n{WIDTH} {HEIGHT}\n255\n").into_bytes();
    pgm.extend(pixels);
    std::fs::write(folder.join("flat.pgm"), pgm).unwrap();
    let yaml = "image: flat.pgm\nresolution: 0.05\norigin: [-3.0, 2.0, 0.0]\nnegate: 0\n\
                occupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let path = folder.join("flat.yaml");
    std::fs::write(&path, yaml).unwrap();
    path
}
