//! Polygons of a grid's cells.

use viola_geometry::{Grid, Point2};

/// A polygon with holes, in metres: the outer ring counter-clockwise, holes clockwise. No ring repeats its
/// first corner at the end.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    pub ring_m: Vec<[f64; 2]>,
    pub holes_m: Vec<Vec<[f64; 2]>>,
}

impl Outline {
    /// Returns the area without the holes.
    pub fn area_m2(&self) -> f64 {
        signed_area_m2(&self.ring_m) + self.holes_m.iter().map(|hole| signed_area_m2(hole)).sum::<f64>()
    }

    /// Returns the outer ring's area, holes included.
    pub fn outer_area_m2(&self) -> f64 {
        signed_area_m2(&self.ring_m)
    }

    /// Returns it with fewer corners, none further than `tolerance_m` from the line; none if degenerate.
    pub fn simplified(&self, tolerance_m: f64) -> Option<Outline> {
        let ring_m = simplify(&self.ring_m, tolerance_m);
        let holes_m = self.holes_m.iter().map(|hole| simplify(hole, tolerance_m));
        let holes_m: Vec<_> = holes_m.filter(|hole| hole.len() >= 3 && signed_area_m2(hole) < 0.0).collect();
        (ring_m.len() >= 3 && signed_area_m2(&ring_m) > 0.0).then_some(Outline { ring_m, holes_m })
    }
}

/// Returns a ring's signed area: positive if counter-clockwise.
pub fn signed_area_m2(ring: &[[f64; 2]]) -> f64 {
    edges(ring).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>() / 2.0
}

/// Returns the lowest and the highest coordinates of corners; infinite ones without corners.
pub fn bounds_m<'a>(corners: impl IntoIterator<Item = &'a [f64; 2]>) -> [[f64; 2]; 2] {
    let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    corners.into_iter().fold(none, |[low, high], corner| {
        [[0, 1].map(|axis| low[axis].min(corner[axis])), [0, 1].map(|axis| high[axis].max(corner[axis]))]
    })
}

/// Returns whether a ring, of either direction, contains a point.
pub fn contains(ring: &[[f64; 2]], point: &Point2) -> bool {
    edges(ring).filter(|(a, b)| crosses(&[*a, *b], point)).count() % 2 == 1
}

/// Returns whether a side crosses the horizontal line through a point on the point's right.
pub(super) fn crosses([a, b]: &[[f64; 2]; 2], point: &Point2) -> bool {
    (a[1] > point.y) != (b[1] > point.y) && point.x < (b[0] - a[0]) * (point.y - a[1]) / (b[1] - a[1]) + a[0]
}

/// Returns the distance from a point to a ring.
pub fn distance_m(ring: &[[f64; 2]], point: &Point2) -> f64 {
    edges(ring).map(|(a, b)| to_segment_m(&[point.x, point.y], &a, &b)).fold(f64::INFINITY, f64::min)
}

/// Returns the distance from a point to a polygon; 0 inside, and not in its holes.
pub fn off_m(ring: &[[f64; 2]], holes: &[Vec<[f64; 2]>], point: &Point2) -> f64 {
    if contains(ring, point) && !holes.iter().any(|hole| contains(hole, point)) {
        return 0.0;
    }
    let of_holes = holes.iter().map(|hole| distance_m(hole, point));
    of_holes.fold(distance_m(ring, point), f64::min)
}

/// Returns the sides of a ring.
pub(super) fn edges(ring: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| (*a, *b))
}

/// Returns the distance from a point to a side.
pub(super) fn to_segment_m(p: &[f64; 2], a: &[f64; 2], b: &[f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length2 = dx * dx + dy * dy;
    let t = if length2 > 0.0 { ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length2 } else { 0.0 };
    let t = t.clamp(0.0, 1.0);
    (p[0] - a[0] - t * dx).hypot(p[1] - a[1] - t * dy)
}

/// Returns the polygons of a mask's set cells. Cells that share only a corner are separate.
pub fn trace(mask: &Grid<bool>) -> Vec<Outline> {
    let frame = mask.frame;
    let corner = |[x, y]: [i64; 2]| {
        [frame.origin_m[0] + x as f64 * frame.cell_m, frame.origin_m[1] + y as f64 * frame.cell_m]
    };
    let (pieces, count) = pieces(mask);
    let mut outlines = vec![Outline { ring_m: Vec::new(), holes_m: Vec::new() }; count];
    for corners in rings(mask) {
        // The cell left of the first edge belongs to the ring's piece.
        let (a, b) = (corners[0], corners[1]);
        let direction = [(b[0] - a[0]).signum(), (b[1] - a[1]).signum()];
        let beside = [0, 1].map(|axis| {
            let left = [-direction[1], direction[0]][axis];
            (a[axis] + (direction[axis] + left - 1) / 2) as usize
        });
        let piece = pieces[beside[1] * frame.width + beside[0]] as usize - 1;
        let ring: Vec<[f64; 2]> = corners.into_iter().map(corner).collect();
        if signed_area_m2(&ring) > 0.0 {
            outlines[piece].ring_m = ring;
        } else {
            outlines[piece].holes_m.push(ring);
        }
    }
    outlines
}

/// Returns the connected piece of every cell (4-neighbourhood), from 1, 0 for none, and the number of pieces.
pub fn pieces(mask: &Grid<bool>) -> (Vec<u32>, usize) {
    let (width, height) = (mask.frame.width, mask.frame.height);
    let mut piece = vec![0u32; width * height];
    let (mut count, mut open) = (0, Vec::new());
    for start in 0..piece.len() {
        if !mask.cells[start] || piece[start] != 0 {
            continue;
        }
        count += 1;
        piece[start] = count;
        open.push(start);
        while let Some(at) = open.pop() {
            for next in beside(at, width, height).into_iter().flatten() {
                if mask.cells[next] && piece[next] == 0 {
                    piece[next] = count;
                    open.push(next);
                }
            }
        }
    }
    (piece, count as usize)
}

/// Returns the indices of the cells that share a side with a cell.
pub fn beside(at: usize, width: usize, height: usize) -> [Option<usize>; 4] {
    let (x, y) = (at % width, at / width);
    [
        (x > 0).then(|| at - 1),
        (x + 1 < width).then(|| at + 1),
        (y > 0).then(|| at - width),
        (y + 1 < height).then(|| at + width),
    ]
}

const STEPS: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// Returns closed paths along the cells' borders with the mask on the left; straight stretches are one edge.
fn rings(mask: &Grid<bool>) -> Vec<Vec<[i64; 2]>> {
    let (width, height) = (mask.frame.width as i64, mask.frame.height as i64);
    let set =
        |x: i64, y: i64| x >= 0 && y >= 0 && x < width && y < height && mask.get(x as usize, y as usize);
    // Directions of the borders that leave each corner, as bits.
    let at = |x: i64, y: i64| (y * (width + 1) + x) as usize;
    let mut leaving = vec![0u8; ((width + 1) * (height + 1)) as usize];
    for y in 0..height {
        for x in 0..width {
            if !set(x, y) {
                continue;
            }
            let sides = [
                (set(x, y - 1), x, y, 0),
                (set(x + 1, y), x + 1, y, 1),
                (set(x, y + 1), x + 1, y + 1, 2),
                (set(x - 1, y), x, y + 1, 3),
            ];
            for (covered, x, y, direction) in sides {
                if !covered {
                    leaving[at(x, y)] |= 1 << direction;
                }
            }
        }
    }
    let mut rings = Vec::new();
    for start in 0..leaving.len() {
        while leaving[start] != 0 {
            let first = leaving[start].trailing_zeros() as usize;
            let mut place = [start as i64 % (width + 1), start as i64 / (width + 1)];
            let (mut direction, mut ring) = (first, Vec::new());
            let mut turned = true;
            loop {
                if turned {
                    ring.push(place);
                }
                leaving[at(place[0], place[1])] &= !(1 << direction);
                place = [place[0] + STEPS[direction][0], place[1] + STEPS[direction][1]];
                let open = leaving[at(place[0], place[1])];
                // Left turns first: around the same cell.
                let next = [1, 0, 3].map(|turn| (direction + turn) % 4);
                match next.into_iter().find(|next| open & (1 << next) != 0) {
                    Some(next) => {
                        turned = next != direction;
                        direction = next;
                    }
                    None => break,
                }
            }
            // The path may start within a straight stretch.
            if ring.len() > 2 && direction == first {
                ring.remove(0);
            }
            rings.push(ring);
        }
    }
    rings
}

/// Simplifies a ring (Douglas and Peucker, 1973) between its first corner and the one furthest from it.
pub fn simplify(ring: &[[f64; 2]], tolerance_m: f64) -> Vec<[f64; 2]> {
    if ring.len() < 4 {
        return ring.to_vec();
    }
    let away = |p: &[f64; 2]| (p[0] - ring[0][0]).hypot(p[1] - ring[0][1]);
    let far = (1..ring.len()).max_by(|a, b| away(&ring[*a]).total_cmp(&away(&ring[*b])).then(b.cmp(a)));
    let far = far.unwrap_or(0);
    let mut kept = vec![false; ring.len()];
    // Spans of bounded length avoid a quadratic time.
    const LONGEST: usize = 500;
    let mut anchors: Vec<usize> = (0..ring.len()).step_by(LONGEST).chain([far]).collect();
    anchors.sort_unstable();
    anchors.dedup();
    anchors.iter().for_each(|i| kept[*i] = true);
    anchors.push(ring.len());
    let mut spans: Vec<(usize, usize)> = anchors.windows(2).map(|w| (w[0], w[1])).collect();
    while let Some((from, to)) = spans.pop() {
        let (a, b) = (ring[from], ring[to % ring.len()]);
        let mut worst = (tolerance_m, None);
        for (i, p) in ring.iter().enumerate().take(to).skip(from + 1) {
            let off_m = to_segment_m(p, &a, &b);
            if off_m > worst.0 {
                worst = (off_m, Some(i));
            }
        }
        if let Some(i) = worst.1 {
            kept[i] = true;
            spans.extend([(from, i), (i, to)]);
        }
    }
    ring.iter().zip(kept).filter(|(_, kept)| *kept).map(|(p, _)| *p).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_geometry::GridFrame;

    fn mask(width: usize, cells: Vec<bool>) -> Grid<bool> {
        let height = cells.len() / width;
        Grid { frame: GridFrame { origin_m: [-1.0, 2.0], cell_m: 0.05, width, height }, cells }
    }

    fn holds(outline: &Outline, p: &Point2) -> bool {
        contains(&outline.ring_m, p) && !outline.holes_m.iter().any(|hole| contains(hole, p))
    }

    proptest! {
        #[test]
        fn outlines_hold_the_set_cells_and_no_others(cells in prop::collection::vec(any::<bool>(), 8 * 9)) {
            let mask = mask(8, cells);
            let outlines = trace(&mask);
            let area: f64 = outlines.iter().map(Outline::area_m2).sum();
            let set = mask.cells.iter().filter(|set| **set).count();
            prop_assert!((area - set as f64 * 0.05 * 0.05).abs() < 1e-9);
            for y in 0..9 {
                for x in 0..8 {
                    let centre = mask.frame.centre(x, y);
                    let around = outlines.iter().filter(|o| holds(o, &centre)).count();
                    prop_assert_eq!(around, usize::from(mask.get(x, y)));
                }
            }
        }

        #[test]
        fn corners_that_are_left_out_are_near(cells in prop::collection::vec(any::<bool>(), 20 * 20), tolerance in 0.0..0.2f64) {
            for outline in trace(&mask(20, cells)) {
                let simple = simplify(&outline.ring_m, tolerance);
                for corner in &outline.ring_m {
                    let off = distance_m(&simple, &Point2::from(*corner));
                    prop_assert!(off <= tolerance + 1e-9, "{off}");
                }
            }
        }
    }

    #[test]
    fn a_square_with_a_hole() {
        let cells = (0..25).map(|i| i != 12).collect();
        let outlines = trace(&mask(5, cells));
        assert_eq!(outlines.len(), 1);
        assert_eq!((outlines[0].ring_m.len(), outlines[0].holes_m.len()), (4, 1));
        assert_eq!(simplify(&outlines[0].ring_m, 0.01).len(), 4);
        assert!(trace(&mask(5, vec![false; 25])).is_empty());
    }

    /// A comb and a chequerboard of half a million cells are traced quickly.
    #[test]
    fn hostile_masks_are_no_work() {
        let comb = |i: usize| (i % 1000).is_multiple_of(2) || i < 1000;
        let chequers = |i: usize| (i % 1000 + i / 1000).is_multiple_of(2);
        let combs: Vec<bool> = (0..500_000).map(comb).collect();
        let outlines = trace(&mask(1000, combs));
        assert_eq!(outlines.len(), 1);
        assert!(outlines[0].simplified(0.06).is_some());
        assert_eq!(trace(&mask(1000, (0..500_000).map(chequers).collect())).len(), 250_000);
    }
}
