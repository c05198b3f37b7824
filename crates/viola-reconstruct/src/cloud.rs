//! The fused surface as points.

use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Pose3, Vector3};

/// The class of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Label {
    pub class: Class,
    /// In 255ths, because there are millions of points.
    probability: u8,
    /// Number of pictures in which a network saw the point.
    pub views: u16,
}

impl Label {
    /// The label of a point without evidence.
    pub const NONE: Label = Label { class: Class::Other, probability: 0, views: 0 };

    pub fn new(class: Class, probability: f32, views: u16) -> Label {
        Label { class, probability: (probability.clamp(0.0, 1.0) * 255.0).round() as u8, views }
    }

    /// Returns the probability, 0 to 1.
    pub fn probability(&self) -> f32 {
        f32::from(self.probability) / 255.0
    }
}

/// A point on the fused surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudPoint {
    pub position_m: [f32; 3],
    /// Unit length, towards the observed side.
    pub normal: [f32; 3],
    pub color: [u8; 3],
    pub label: Label,
    /// Sum over its readings of 256 / range², range in metres, because depth noise grows with the range.
    pub weight: u16,
}

impl CloudPoint {
    pub fn position(&self) -> Point3 {
        Point3::new(
            f64::from(self.position_m[0]),
            f64::from(self.position_m[1]),
            f64::from(self.position_m[2]),
        )
    }

    pub fn normal(&self) -> Vector3 {
        Vector3::new(f64::from(self.normal[0]), f64::from(self.normal[1]), f64::from(self.normal[2]))
    }
}

/// Surface points, about one for each voxel face, so that their number measures area.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    pub points: Vec<CloudPoint>,
    /// Side of the source voxels, in metres.
    pub voxel_m: f64,
}

impl PointCloud {
    /// Returns the points in another frame.
    pub fn transformed(mut self, to_from_this: &Pose3) -> PointCloud {
        for point in &mut self.points {
            let position = to_from_this * point.position();
            let normal = to_from_this * point.normal();
            point.position_m = [position.x as f32, position.y as f32, position.z as f32];
            point.normal = [normal.x as f32, normal.y as f32, normal.z as f32];
        }
        self
    }
}
