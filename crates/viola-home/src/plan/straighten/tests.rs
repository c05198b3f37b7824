use super::super::oblique::tests::face;
use super::*;

/// Stairs down a line of 45 degrees, with the corners on both sides of it: x + y is 1.0 and 1.2.
const STAIRS: [[f64; 2]; 11] = [
    [0.0, 1.0],
    [0.2, 1.0],
    [0.2, 0.8],
    [0.4, 0.8],
    [0.4, 0.6],
    [0.6, 0.6],
    [0.6, 0.4],
    [0.8, 0.4],
    [0.8, 0.2],
    [1.0, 0.2],
    [1.0, 0.0],
];

#[test]
fn a_side_of_two_rooms_is_moved_for_neither() {
    let ring = |ring_m: Vec<[f64; 2]>| Outline { ring_m, holes_m: Vec::new() };
    let upper = ring(STAIRS.into_iter().chain([[2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]).collect());
    // The face looks into the upper room.
    let faces = [face([0.0, 1.1], -45.0, 1.556)];
    // Distances of the lower room: a border without a wall, a wall thinner than the stairs, a wall.
    for (apart_m, corners) in [(0.0, 14), (0.02, 14), (0.3, 5)] {
        let stairs = STAIRS.into_iter().rev().map(|[x, y]| [x - apart_m, y - apart_m]);
        let lower = ring([[-apart_m, -apart_m]].into_iter().chain(stairs).collect());
        let mut outlines = [upper.clone(), lower.clone()];
        let sides = straighten(&mut outlines, &faces);
        assert_eq!(outlines[0].ring_m.len(), corners, "{apart_m}: {:?}", outlines[0]);
        assert_eq!((sides.len(), outlines[0] == upper), if corners == 5 { (1, false) } else { (0, true) });
        assert_eq!(outlines[1], lower);
        assert!(common_m2(&outlines[0], &outlines[1]) < 1e-6, "{apart_m}");
    }
}
