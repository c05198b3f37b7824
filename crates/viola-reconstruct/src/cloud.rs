//! The fused surface as points.

use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Pose3, Vector3};

/// A class with its probability in 255ths, because there are millions of points.
pub type ClassFraction = (Class, u8);

/// Number of further classes of a label: with the first they hold nearly all of the probability.
pub const OTHER_CLASSES: usize = 3;

/// The class of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Label {
    pub class: Class,
    probability: u8,
    /// Number of pictures in which a network saw the point.
    pub views: u16,
    /// The next classes, for the fusion with other clips. Places that are not needed have probability 0.
    others: [ClassFraction; OTHER_CLASSES],
}

/// Place in `others` that is not needed.
const NO_CLASS: ClassFraction = (Class::Other, 0);

impl Label {
    /// The label of a point without evidence.
    pub const NONE: Label =
        Label { class: Class::Other, probability: 0, views: 0, others: [NO_CLASS; OTHER_CLASSES] };

    pub fn new(class: Class, probability: f32, views: u16) -> Label {
        Label { class, probability: in_255ths(probability), views, ..Label::NONE }
    }

    /// Returns the label with its next classes; only the first [`OTHER_CLASSES`] are kept.
    pub fn with_others(self, others: impl IntoIterator<Item = (Class, f32)>) -> Label {
        self.with_fractions(others.into_iter().map(|(class, probability)| (class, in_255ths(probability))))
    }

    /// The same in 255ths.
    pub fn with_fractions(mut self, fractions: impl IntoIterator<Item = ClassFraction>) -> Label {
        self.others = [NO_CLASS; OTHER_CLASSES];
        let known = fractions.into_iter().filter(|(_, fraction)| *fraction > 0);
        self.others.iter_mut().zip(known).for_each(|(place, fraction)| *place = fraction);
        self
    }

    /// Returns the probability, 0 to 1.
    pub fn probability(&self) -> f32 {
        f32::from(self.probability) / 255.0
    }

    /// Returns the next classes; those with probability 0 are no classes.
    pub fn others(&self) -> [ClassFraction; OTHER_CLASSES] {
        self.others
    }

    /// Returns all known classes, the label's own first.
    pub fn fractions(&self) -> impl Iterator<Item = ClassFraction> {
        let all = std::iter::once((self.class, self.probability)).chain(self.others);
        all.filter(|(_, fraction)| *fraction > 0)
    }
}

fn in_255ths(probability: f32) -> u8 {
    (probability.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// The colour of a point that no picture showed. A black surface has [`BLACK`].
pub const NO_COLOR: [u8; 3] = [0; 3];
/// The darkest colour.
pub const BLACK: [u8; 3] = [1; 3];

/// A point on the fused surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudPoint {
    pub position_m: [f32; 3],
    /// Unit length, towards the observed side.
    pub normal: [f32; 3],
    /// [`NO_COLOR`] if no picture showed the point.
    pub color: [u8; 3],
    pub label: Label,
    /// Sum over its readings of 256 / range², range in metres, because depth noise grows with the range.
    pub weight: u16,
}

impl CloudPoint {
    /// Returns a point of the smallest weight without colour and label.
    pub fn new(position_m: [f32; 3], normal: [f32; 3]) -> CloudPoint {
        CloudPoint { position_m, normal, color: NO_COLOR, label: Label::NONE, weight: 1 }
    }

    pub fn position(&self) -> Point3 {
        Point3::from(self.position_m.map(f64::from))
    }

    pub fn normal(&self) -> Vector3 {
        Vector3::from(self.normal.map(f64::from))
    }
}

/// Surface points, about one for each voxel face, so their number measures area.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PointCloud {
    pub points: Vec<CloudPoint>,
    /// Side of the source voxels, in metres.
    pub voxel_m: f64,
}

impl PointCloud {
    /// Returns the points with positions multiplied by `factor`.
    pub fn scaled(mut self, factor: f64) -> PointCloud {
        self.voxel_m *= factor;
        let positions = self.points.iter_mut().flat_map(|point| &mut point.position_m);
        positions.for_each(|axis| *axis = (f64::from(*axis) * factor) as f32);
        self
    }

    /// Returns the points in another frame.
    pub fn transformed(mut self, to_from_this: &Pose3) -> PointCloud {
        for point in &mut self.points {
            point.position_m = (to_from_this * point.position()).map(|axis| axis as f32).into();
            point.normal = (to_from_this * point.normal()).map(|axis| axis as f32).into();
        }
        self
    }
}
