//! LiDAR maps that no robot makes.

use super::try_align;
use std::fmt::Write;
use viola_testing::{room, zips};

/// Metres a cell of the drawn maps.
const CELL_M: f64 = 0.05;

/// Returns a ROS map of `side` x `side` cells.
fn drawn(side: usize, is_wall: impl Fn(usize, usize) -> bool) -> Vec<u8> {
    let yaml = format!(
        "image: map.pgm\nresolution: {CELL_M}\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    let mut pgm = format!("P5\n{side} {side}\n255\n").into_bytes();
    pgm.extend((0..side * side).map(|at| if is_wall(at % side, at / side) { 0 } else { 254 }));
    zips::zip(&vec![("map.yaml".to_owned(), yaml.into_bytes()), ("map.pgm".to_owned(), pgm)])
}

fn csv(points: impl Iterator<Item = (f64, f64)>) -> Vec<u8> {
    let mut text = String::from("x,y\n");
    for (x, y) in points {
        writeln!(text, "{x},{y}").unwrap();
    }
    text.into_bytes()
}

/// Aligns a clip of a room to a map in which it is not: any answer but `aligned` is right.
fn is_not_found_in(map: &[u8]) {
    let answer = try_align(&room::clip(12), map).unwrap();
    assert_ne!(answer["state"], "aligned", "{answer:#}");
}

fn is_refused(map: &[u8], why: &str) {
    let refusal = try_align(&room::clip(12), map).unwrap_err();
    assert!(refusal.contains(why), "{refusal}");
}

#[test]
fn a_million_isolated_cells_are_searched_within_the_limits() {
    is_not_found_in(&csv((0..1_000_000).map(|n| (0.24 * f64::from(n % 1000), 0.24 * f64::from(n / 1000)))));
}

#[test]
fn a_map_of_walls_alone_is_searched_within_the_limits() {
    is_not_found_in(&drawn(2200, |_, _| true));
}

/// Corridors of a metre: every second wall is open, drawn by a hash of its place.
#[test]
fn a_maze_is_searched_within_the_limits() {
    const CORRIDOR: usize = 20;
    is_not_found_in(&drawn(2000, |x, y| {
        let is_open = ((x / CORRIDOR) * 31 + (y / CORRIDOR) * 17) % 5 < 2;
        (x % CORRIDOR == 0 && !is_open) || (y % CORRIDOR == 0 && is_open)
    }));
}

#[test]
fn maps_of_kilometres_are_refused() {
    is_refused(b"x,y\n0,0\n99999,99999\n", "250 m");
    // A wall of 5 km.
    is_refused(&csv((0..100_000).map(|n| (0.05 * f64::from(n), 0.0))), "250 m");
}

#[test]
fn maps_without_walls_are_refused() {
    is_refused(b"", "empty");
    is_refused(b"x,y\n", "no");
    is_refused(&drawn(100, |_, _| false), "no");
}
