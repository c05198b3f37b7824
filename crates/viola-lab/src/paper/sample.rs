//! Farthest-point sampling.

use viola_geometry::Point2;

/// Returns up to `most` distinct points, each the farthest from those already taken, starting with the first
/// point.
pub(super) fn farthest(points_m: &[Point2], most: usize) -> Vec<Point2> {
    let mut taken = Vec::with_capacity(most.min(points_m.len()));
    let mut gap_m2 = vec![f64::INFINITY; points_m.len()];
    let mut next = points_m.first();
    while let Some(&chosen) = next
        && taken.len() < most
    {
        taken.push(chosen);
        let mut farthest = (0, 0.0);
        for (i, (point, gap_m2)) in points_m.iter().zip(&mut gap_m2).enumerate() {
            *gap_m2 = gap_m2.min((point - chosen).norm_squared());
            if *gap_m2 > farthest.1 {
                farthest = (i, *gap_m2);
            }
        }
        next = (farthest.1 > 0.0).then(|| &points_m[farthest.0]);
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_first_then_the_middle() {
        let line: Vec<Point2> = (0..=10).map(|i| Point2::new(f64::from(i), 0.0)).collect();
        let xs = |most| farthest(&line, most).iter().map(|p| p.x).collect::<Vec<_>>();
        assert_eq!(xs(3), [0.0, 10.0, 5.0]);
        assert_eq!(xs(99).len(), 11);
        assert_eq!(xs(0).len(), 0);
        assert_eq!(farthest(&[line[0], line[0]], 2).len(), 1, "the same place is one point");
    }
}
