//! Places, boxes and rows along the plan's axes.

use std::borrow::Borrow;

/// Returns a place by its coordinate on an axis and the one on the other axis.
pub(super) fn place<T>(axis: usize, on_axis: T, other: T) -> [T; 2] {
    if axis == 0 { [on_axis, other] } else { [other, on_axis] }
}

/// Returns the lowest and the highest coordinate of corners along each axis.
pub(super) fn span(corners: impl IntoIterator<Item: Borrow<[f64; 2]>>) -> [[f64; 2]; 2] {
    corners.into_iter().fold([[f64::INFINITY, f64::NEG_INFINITY]; 2], |span, corner| {
        let corner: &[f64; 2] = corner.borrow();
        [0, 1].map(|axis| [span[axis][0].min(corner[axis]), span[axis][1].max(corner[axis])])
    })
}

/// Returns whether two spans have no common area.
pub(super) fn are_apart([a, b]: &[[[f64; 2]; 2]; 2]) -> bool {
    (0..2).any(|axis| a[axis][1] <= b[axis][0] || b[axis][1] <= a[axis][0])
}

/// Returns the middle of a part of a box that is divided into equal steps along each axis, by the part's number.
pub(super) fn sample(span: [[f64; 2]; 2], steps: usize, number: usize) -> [f64; 2] {
    let at = [number % steps, number / steps];
    [0, 1].map(|axis| {
        let [low, high] = span[axis];
        low + (at[axis] as f64 + 0.5) / steps as f64 * (high - low)
    })
}

/// Returns the places between lines that lie, in a row along an axis, between two set ones at most `widest_m` apart.
pub(super) fn slots(
    lines: [&[f64]; 2],
    axis: usize,
    widest_m: f64,
    is_set: impl Fn([usize; 2]) -> bool,
) -> Vec<[usize; 2]> {
    let count = lines.map(|lines| lines.len() - 1);
    let mut slots = Vec::new();
    for row in 0..count[1 - axis] {
        let mut last: Option<usize> = None;
        for i in (0..count[axis]).filter(|i| is_set(place(axis, *i, row))) {
            if let Some(last) = last.filter(|last| lines[axis][i] - lines[axis][last + 1] <= widest_m) {
                slots.extend((last + 1..i).map(|between| place(axis, between, row)));
            }
            last = Some(i);
        }
    }
    slots
}
