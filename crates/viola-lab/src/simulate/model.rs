//! Surfaces of triangles as basic shapes.

use crate::mesh::Mesh;
use parry3d_f64::math::Vector;
use parry3d_f64::query::{PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::{TriMesh, TriMeshBuilderError};
use viola_geometry::{Point3, Vector3};

/// A surface of triangles, in -1..1 along each axis. It has no inside.
#[derive(Debug)]
pub struct Model {
    mesh: TriMesh,
}

/// A model is the same as itself only: models are not copied.
impl PartialEq for Model {
    fn eq(&self, other: &Model) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Eq for Model {}

impl Model {
    /// Stretches a mesh to the unit shape. Returns it with the mesh's full size in metres.
    pub fn of(mesh: &Mesh) -> Result<(Model, [f64; 3]), TriMeshBuilderError> {
        let (mut low, mut high) = (Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3]));
        for corner in mesh.corners().flatten() {
            (low, high) = (low.inf(&corner), high.sup(&corner));
        }
        let half = (high - low) / 2.0;
        let unit = |point: &Point3| {
            let [x, y, z] = [0, 1, 2].map(|axis| {
                let from_middle = point[axis] - (low[axis] + high[axis]) / 2.0;
                if half[axis] > 0.0 { from_middle / half[axis] } else { 0.0 }
            });
            Vector::new(x, y, z)
        };
        let mesh = TriMesh::new(mesh.vertices_m.iter().map(unit).collect(), mesh.triangles.clone())?;
        Ok((Model { mesh }, (high - low).into()))
    }

    /// Returns the distance to the first triangle along a ray, in units of its direction, up to `reach`.
    pub fn cast(&self, origin: &Vector3, direction: &Vector3, reach: f64) -> Option<f64> {
        let ray = Ray::new(vector(origin), vector(direction));
        self.mesh.cast_local_ray(&ray, reach, false).filter(|distance| *distance > 0.0)
    }

    /// Returns the normal of the triangle nearest to a point.
    pub fn normal(&self, point: &Vector3) -> Vector3 {
        let (_, (nearest, _)) = self.mesh.project_local_point_and_get_location(vector(point), false);
        self.mesh.triangle(nearest).normal().map_or_else(Vector3::z, |n| Vector3::new(n.x, n.y, n.z))
    }
}

fn vector(of: &Vector3) -> Vector {
    Vector::new(of.x, of.y, of.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tent: two slopes that meet at x = 0, 1 m above their feet at x = -2 and 2, 4 m long.
    fn tent() -> Mesh {
        let points = [
            [-2.0, 0.0, 0.0],
            [-2.0, 4.0, 0.0],
            [0.0, 4.0, 1.0],
            [0.0, 0.0, 1.0],
            [2.0, 0.0, 0.0],
            [2.0, 4.0, 0.0],
        ];
        Mesh {
            vertices_m: points.map(Point3::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]],
            labels: vec![],
        }
    }

    #[test]
    fn rays_meet_triangles_from_both_sides() {
        let (model, size_m) = Model::of(&tent()).unwrap();
        assert_eq!(size_m, [4.0, 4.0, 1.0]);
        let down = Vector3::new(0.0, 0.0, -1.0);
        // The unit shape is 2 high: at x = 0.5 the slope is halfway between its foot and the ridge.
        let cases = [
            (Vector3::new(0.5, 0.0, 3.0), down, Some(3.0)),
            (Vector3::new(0.5, 0.0, -3.0), -down, Some(3.0)),
            (Vector3::new(0.5, 0.0, -3.0), down, None),
            (Vector3::new(1.5, 0.0, 3.0), down, None),
        ];
        for (origin, direction, expected) in cases {
            let found = model.cast(&origin, &direction, 10.0);
            assert_eq!(found.is_some(), expected.is_some(), "{origin:?}");
            assert!(found.zip(expected).is_none_or(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
            assert_eq!(model.cast(&origin, &direction, 2.9), None, "beyond reach");
        }
        // In the unit shape the slopes fall by 2 over 1.
        let normal = model.normal(&Vector3::new(0.5, 0.0, 0.0));
        assert!((normal.x - 2.0 * normal.z).abs() < 1e-9 && normal.y.abs() < 1e-9, "{normal:?}");
    }
}
