//! Ray casting of solids with a bounding volume hierarchy.

use super::finish::{Finish, Optics};
use super::solid::{CUSHION_RADIUS, Shape, Solid};
use nalgebra::Matrix3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry3d_f64::query::Ray;
use std::cell::Cell;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Vector3};

/// First hit of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// In units of the ray's direction.
    pub distance: f64,
    /// Index of the solid in its scene.
    pub solid: usize,
}

/// A solid with its precomputed transform.
#[derive(Debug, Clone)]
pub(super) struct Primitive {
    pub shape: Shape,
    pub centre: Point3,
    pub unit_from_home: Matrix3<f64>,
    pub home_from_unit: Matrix3<f64>,
    pub low: Point3,
    pub high: Point3,
    pub half: Vector3,
    pub class: Class,
    /// Number of its piece; 0 is the building.
    pub instance: u16,
    pub finish: Finish,
}

impl Primitive {
    fn new(solid: &Solid, instance: u16) -> Primitive {
        let bounds = solid.half_bounds();
        Primitive {
            shape: solid.shape,
            centre: solid.centre,
            unit_from_home: solid.unit_from_home(),
            home_from_unit: solid.home_from_unit(),
            low: solid.centre - bounds,
            high: solid.centre + bounds,
            half: solid.half,
            class: solid.class,
            instance,
            finish: solid.finish,
        }
    }

    /// Returns whether it is not of glass.
    pub fn is_solid(&self) -> bool {
        self.finish.optics != Optics::Glass
    }

    /// Returns the distance to the first surface in front of the origin; none from inside.
    pub fn intersect(&self, origin: &Point3, direction: &Vector3) -> Option<f64> {
        let o = self.unit_from_home * (origin - self.centre);
        let d = self.unit_from_home * direction;
        let slab = |axis: usize| {
            let (a, b) = ((-1.0 - o[axis]) / d[axis], (1.0 - o[axis]) / d[axis]);
            (a.min(b), a.max(b))
        };
        let round = |axes: &[usize], radius: f64| {
            let dot = |a: &Vector3, b: &Vector3| axes.iter().map(|&k| a[k] * b[k]).sum::<f64>();
            let (a, b, c) = (dot(&d, &d), dot(&o, &d), dot(&o, &o) - radius * radius);
            let root = (b * b - a * c).sqrt();
            ((-b - root) / a, (-b + root) / a)
        };
        let block = || {
            let ((x0, x1), (y0, y1), (z0, z1)) = (slab(0), slab(1), slab(2));
            (x0.max(y0).max(z0), x1.min(y1).min(z1))
        };
        let (enter, leave) = match self.shape {
            Shape::Mesh(model) => return model.cast(&o, &d, f64::INFINITY),
            Shape::Block => block(),
            Shape::Cylinder => {
                let ((r0, r1), (z0, z1)) = (round(&[0, 1], 1.0), slab(2));
                if r0.is_nan() {
                    // The ray passes the cylinder, or is parallel to its axis.
                    let along = d.x == 0.0 && d.y == 0.0 && o.x.hypot(o.y) < 1.0;
                    if along { (z0, z1) } else { return None }
                } else {
                    (r0.max(z0), r1.min(z1))
                }
            }
            Shape::Ball => round(&[0, 1, 2], 1.0),
            Shape::Cushion => {
                let ((r0, r1), (b0, b1)) = (round(&[0, 1, 2], CUSHION_RADIUS), block());
                if r0.is_nan() {
                    return None;
                }
                (r0.max(b0), r1.min(b1))
            }
        };
        (enter <= leave && enter > 0.0).then_some(enter)
    }

    pub fn contains(&self, point: &Point3) -> bool {
        let local = self.unit_from_home * (point - self.centre);
        match self.shape {
            // Its triangles need not be closed.
            Shape::Block | Shape::Mesh(_) => local.amax() <= 1.0,
            Shape::Cylinder => local.x.hypot(local.y) <= 1.0 && local.z.abs() <= 1.0,
            Shape::Ball => local.norm() <= 1.0,
            Shape::Cushion => local.amax() <= 1.0 && local.norm() <= CUSHION_RADIUS,
        }
    }

    /// Returns a surface point in the unit shape's frame, and the outward normal in the home's frame.
    pub fn surface(&self, point: &Point3) -> (Vector3, Vector3) {
        let local = self.unit_from_home * (point - self.centre);
        let normal = match self.shape {
            Shape::Ball => local,
            Shape::Mesh(model) => model.normal(&local),
            Shape::Cushion if local.norm() > CUSHION_RADIUS * local.amax() => local,
            Shape::Cylinder if local.z.abs() < local.x.hypot(local.y) => Vector3::new(local.x, local.y, 0.0),
            Shape::Cylinder => Vector3::new(0.0, 0.0, local.z.signum()),
            Shape::Block | Shape::Cushion => {
                let axis = local.iamax();
                let mut normal = Vector3::zeros();
                normal[axis] = local[axis].signum();
                normal
            }
        };
        (local, (self.unit_from_home.transpose() * normal).normalize())
    }
}

fn vector(of: &Vector3) -> Vector {
    Vector::new(of.x, of.y, of.z)
}

/// All solids of one day.
#[derive(Debug, Clone)]
pub struct Scene {
    pub(super) primitives: Vec<Primitive>,
    bvh: Bvh,
}

impl Scene {
    /// Builds a scene of solids with the numbers of their pieces.
    pub(super) fn new(solids: impl IntoIterator<Item = (Solid, u16)>) -> Scene {
        Scene::of(solids.into_iter().map(|(solid, instance)| Primitive::new(&solid, instance)).collect())
    }

    /// Returns the solids that cross this height: all that a horizontal ray there can hit.
    pub(super) fn slice(&self, height_m: f64) -> Scene {
        let crosses = |p: &&Primitive| p.low.z <= height_m && height_m <= p.high.z;
        Scene::of(self.primitives.iter().filter(crosses).cloned().collect())
    }

    fn of(primitives: Vec<Primitive>) -> Scene {
        let bounds: Vec<Aabb> =
            primitives.iter().map(|p| Aabb::new(vector(&p.low.coords), vector(&p.high.coords))).collect();
        Scene { primitives, bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &bounds) }
    }

    pub fn len(&self) -> usize {
        self.primitives.len()
    }

    pub fn is_empty(&self) -> bool {
        self.primitives.is_empty()
    }

    /// Returns the class of a solid by its index in a [`Hit`].
    pub fn class(&self, solid: usize) -> Class {
        self.primitives[solid].class
    }

    /// Returns the first surface along a ray, up to `reach` times its direction. Solids that contain the
    /// origin are not hit.
    pub fn cast(&self, origin: &Point3, direction: &Vector3, reach: f64) -> Option<Hit> {
        self.cast_where(origin, direction, reach, |_| true)
    }

    /// Returns the first surface along a ray that passes through glass.
    pub fn cast_through_glass(&self, origin: &Point3, direction: &Vector3, reach: f64) -> Option<Hit> {
        self.cast_where(origin, direction, reach, Primitive::is_solid)
    }

    pub(super) fn cast_where(
        &self,
        origin: &Point3,
        direction: &Vector3,
        reach: f64,
        counts: impl Fn(&Primitive) -> bool,
    ) -> Option<Hit> {
        let best_so_far = Cell::new(Hit { distance: reach, solid: usize::MAX });
        let ray = Ray::new(vector(&origin.coords), vector(direction));
        self.bvh.cast_ray(&ray, reach, |leaf, _| {
            let solid = leaf as usize;
            let primitive = Some(&self.primitives[solid]).filter(|primitive| counts(primitive))?;
            let distance = primitive.intersect(origin, direction)?;
            let best = best_so_far.get();
            // The lower index wins a tie, whatever the order of the leaves.
            if distance < best.distance || distance == best.distance && solid < best.solid {
                best_so_far.set(Hit { distance, solid });
            }
            // A little more, so that boxes at the same distance are still visited.
            Some(distance * (1.0 + 1e-12) + 1e-12)
        });
        let best = best_so_far.get();
        (best.solid != usize::MAX).then_some(best)
    }

    /// Returns whether a point is inside a solid.
    pub fn is_inside(&self, point: &Point3) -> bool {
        let at = vector(&point.coords);
        let mut leaves = self.bvh.leaves(|node| node.aabb().contains_local_point(at));
        leaves.any(|leaf| self.primitives[leaf as usize].contains(point))
    }

    /// Returns the class of a solid, and the number of its piece; 0 is the building.
    pub fn label(&self, solid: usize) -> (Class, u16) {
        (self.primitives[solid].class, self.primitives[solid].instance)
    }

    /// Returns the normal of a solid's surface at a point on it.
    pub fn normal(&self, solid: usize, point: &Point3) -> Vector3 {
        self.primitives[solid].surface(point).1
    }
}

#[cfg(test)]
mod tests {
    use super::super::finish::{Finish, WHITE};
    use super::super::render::{NOTHING, render};
    use super::*;
    use viola_geometry::{Pinhole, Pose3};

    fn solid(shape: Shape, centre: [f64; 3], half: [f64; 3], yaw_rad: f64, tilt_rad: f64) -> Solid {
        let roll_rad = 0.0;
        let finish = Finish::plain(WHITE);
        let (centre, half) = (Point3::from(centre), Vector3::from(half));
        Solid { shape, centre, half, yaw_rad, tilt_rad, roll_rad, class: Class::Box, finish }
    }

    /// Distances computed by hand.
    #[test]
    fn rays_end_where_geometry_says() {
        let root = std::f64::consts::SQRT_2;
        let eighth = std::f64::consts::FRAC_PI_4;
        let unit = [1.0, 1.0, 1.0];
        let ahead = [1.0, 0.0, 0.0];
        let soft = solid(Shape::Cushion, [5.0, 0.0, 0.0], unit, 0.0, 0.0);
        let cases = [
            (solid(Shape::Block, [5.0, 0.0, 0.0], unit, 0.0, 0.0), [0.0; 3], ahead, Some(4.0)),
            // A block rotated by 45 degrees shows its edge.
            (solid(Shape::Block, [5.0, 0.0, 0.0], unit, eighth, 0.0), [0.0; 3], ahead, Some(5.0 - root)),
            // Tilted by 45 degrees about x, seen along y.
            (
                solid(Shape::Block, [0.0, 5.0, 0.0], unit, 0.0, eighth),
                [0.0; 3],
                [0.0, 1.0, 0.0],
                Some(5.0 - root),
            ),
            (solid(Shape::Block, [5.0, 0.0, 0.0], [1.0, 0.1, 1.0], 0.0, 0.0), [0.0, 0.2, 0.0], ahead, None),
            (solid(Shape::Cylinder, [5.0, 0.0, 0.0], [0.5, 0.5, 1.0], 0.0, 0.0), [0.0; 3], ahead, Some(4.5)),
            // 0.3 off its axis: the chord begins 0.4 before the middle.
            (solid(Shape::Cylinder, [5.0, 0.3, 0.0], [0.5, 0.5, 1.0], 0.0, 0.0), [0.0; 3], ahead, Some(4.6)),
            (solid(Shape::Cylinder, [5.0, 0.0, 3.0], [0.5, 0.5, 1.0], 0.0, 0.0), [0.0; 3], ahead, None),
            // From above, along the axis.
            (
                solid(Shape::Cylinder, [0.0, 0.0, -3.0], [0.5, 0.5, 1.0], 0.0, 0.0),
                [0.0; 3],
                [0.0, 0.0, -1.0],
                Some(2.0),
            ),
            (solid(Shape::Ball, [5.0, 0.0, 0.0], [2.0, 1.0, 1.0], 0.0, 0.0), [0.0; 3], ahead, Some(3.0)),
            (
                solid(Shape::Ball, [5.0, 0.0, 0.0], [2.0, 1.0, 1.0], 2.0 * eighth, 0.0),
                [0.0; 3],
                ahead,
                Some(4.0),
            ),
            // The flat of a cushion, its rounded edge, and the missing edge of its block.
            (soft, [0.0; 3], ahead, Some(4.0)),
            (soft, [0.0, 0.9, 0.0], ahead, Some(5.0 - 0.88f64.sqrt())),
            (Solid { yaw_rad: eighth, ..soft }, [0.0; 3], ahead, Some(3.7)),
            (soft, [0.0, 0.95, 0.95], ahead, None),
            // Rolled by 45 degrees about y, seen along x.
            (Solid { roll_rad: eighth, shape: Shape::Block, ..soft }, [0.0; 3], ahead, Some(5.0 - root)),
            // Behind the eye, and around it.
            (solid(Shape::Block, [-5.0, 0.0, 0.0], unit, 0.0, 0.0), [0.0; 3], ahead, None),
            (solid(Shape::Ball, [0.0, 0.0, 0.0], unit, 0.0, 0.0), [0.0; 3], ahead, None),
        ];
        for (index, (solid, origin, direction, expected)) in cases.into_iter().enumerate() {
            let scene = Scene::new([(solid, 1)]);
            let (origin, direction) = (Point3::from(origin), Vector3::from(direction));
            let hit = scene.cast(&origin, &direction, 100.0).map(|hit| hit.distance);
            let same = match (hit, expected) {
                (Some(a), Some(b)) => f64::abs(a - b) < 1e-9,
                (a, b) => a == b,
            };
            assert!(same, "case {index}: {hit:?}, not {expected:?}");
            assert_eq!(scene.cast(&origin, &direction, 1.9), None, "case {index}: beyond reach");
            // The renderer looks along z; its middle pixel is the same ray.
            let turn =
                nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), &direction).unwrap_or_else(|| {
                    nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
                });
            let camera = Pinhole { width: 33, height: 33, fx: 40.0, fy: 40.0, cx: 16.0, cy: 16.0 };
            let view = render(&scene, &camera, &Pose3::from_parts(origin.coords.into(), turn));
            let middle = 16 * 33 + 16;
            match expected {
                Some(distance) => {
                    assert!((f64::from(view.depth_m[middle]) - distance).abs() < 1e-4, "case {index}")
                }
                None => assert_eq!(view.solid[middle], NOTHING, "case {index}"),
            }
        }
    }

    #[test]
    fn normals_point_outwards() {
        for shape in [Shape::Block, Shape::Cylinder, Shape::Ball, Shape::Cushion] {
            let scene = Scene::new([(solid(shape, [3.0, 0.2, 0.1], [0.7, 0.5, 0.9], 0.4, 0.3), 1)]);
            let direction = Vector3::new(1.0, 0.02, 0.0);
            let hit = scene.cast(&Point3::origin(), &direction, 10.0).unwrap();
            let point = Point3::origin() + direction * hit.distance;
            let normal = scene.normal(hit.solid, &point);
            assert!((normal.norm() - 1.0).abs() < 1e-9 && normal.dot(&direction) < 0.0, "{shape:?}");
            assert!(scene.is_inside(&(point - normal * 1e-6)) && !scene.is_inside(&(point + normal * 1e-6)));
        }
    }

    #[test]
    fn the_hierarchy_finds_what_a_list_finds() {
        let mut rng = super::super::rng::Rng::new(5);
        let mut around = |reach: f64| [0; 3].map(|_: i32| rng.between(-reach, reach));
        let solids: Vec<(Solid, u16)> = (0..200)
            .map(|k| {
                let shape = [Shape::Block, Shape::Cylinder, Shape::Ball, Shape::Cushion][k % 4];
                let half = around(0.4).map(|v: f64| v.abs() + 0.02);
                let [yaw, tilt, roll_rad] = around(3.0);
                (Solid { roll_rad, ..solid(shape, around(4.0), half, yaw, tilt) }, k as u16)
            })
            .collect();
        let scene = Scene::new(solids);
        for _ in 0..2000 {
            let (origin, direction) = (Point3::from(around(5.0)), Vector3::from(around(1.0)));
            let listed = scene
                .primitives
                .iter()
                .filter_map(|primitive| primitive.intersect(&origin, &direction))
                .fold(f64::INFINITY, f64::min);
            let found = scene.cast(&origin, &direction, 1e9).map_or(f64::INFINITY, |hit| hit.distance);
            assert_eq!(found, listed);
            let inside = scene.primitives.iter().any(|primitive| primitive.contains(&origin));
            assert_eq!(scene.is_inside(&origin), inside);
        }
    }
}
