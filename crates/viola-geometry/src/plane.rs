//! Planes in space.

use super::{Point3, Vector3};

/// The points `x` with `normal . x = offset_m`; `normal` has length one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    pub normal: Vector3,
    pub offset_m: f64,
}

impl Plane {
    pub fn through(point: &Point3, normal: Vector3) -> Plane {
        let normal = normal.normalize();
        Plane { normal, offset_m: normal.dot(&point.coords) }
    }

    /// Returns the signed distance, positive on the side that the normal points to.
    #[inline]
    pub fn height_m(&self, point: &Point3) -> f64 {
        self.normal.dot(&point.coords) - self.offset_m
    }

    /// Returns the plane with its normal to the side of a direction.
    pub fn facing(self, direction: &Vector3) -> Plane {
        if self.normal.dot(direction) < 0.0 {
            Plane { normal: -self.normal, offset_m: -self.offset_m }
        } else {
            self
        }
    }

    /// Returns the plane of least squared distance to the points, or `None` if they do not span one.
    pub fn fit(points: &[&Point3]) -> Option<Plane> {
        if points.len() < 3 {
            return None;
        }
        let mut sum = Vector3::zeros();
        for point in points {
            sum += point.coords;
        }
        let mean = sum / points.len() as f64;
        let mut scatter = nalgebra::Matrix3::zeros();
        for point in points {
            let d = point.coords - mean;
            scatter += d * d.transpose();
        }
        let eigen = scatter.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        if eigen.eigenvalues[order[1]] <= 1e-9 * eigen.eigenvalues[order[2]].max(1e-12) {
            return None;
        }
        let normal = eigen.eigenvectors.column(order[0]).into_owned();
        Some(Plane::through(&Point3::from(mean), normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_a_tilted_plane() {
        let truth = Plane::through(&Point3::new(0.0, 0.0, 1.0), Vector3::new(0.1, -0.2, 1.0));
        let points: Vec<Point3> = (0..100)
            .map(|i| {
                let (x, y) = (f64::from(i % 10), f64::from(i / 10));
                let z = (truth.offset_m - truth.normal.x * x - truth.normal.y * y) / truth.normal.z;
                Point3::new(x, y, z)
            })
            .collect();
        let plane = Plane::fit(&points.iter().collect::<Vec<_>>()).unwrap().facing(&Vector3::z());
        assert!((plane.normal - truth.normal).norm() < 1e-9);
        assert!((plane.offset_m - truth.offset_m).abs() < 1e-9);
        assert!((plane.height_m(&Point3::new(0.0, 0.0, 2.0)) - truth.normal.z).abs() < 1e-9);
    }

    #[test]
    fn a_line_is_no_plane() {
        let line: Vec<Point3> = (0..10).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        let line: Vec<&Point3> = line.iter().collect();
        assert_eq!(Plane::fit(&line), None);
        assert_eq!(Plane::fit(&line[..2]), None);
    }
}
