//! Coordinates of robots and of their software: whole millimetres or centimetres, y up or down.

use serde::Serialize;

/// A robot's coordinates: those of the map's frame, scaled, possibly mirrored, and moved. They are never turned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RobotFrame {
    /// 1000 for millimetres, 100 for centimetres, 1 for metres.
    pub units_per_m: f64,
    /// The map frame's origin in the robot's coordinates.
    pub origin: [f64; 2],
    pub is_y_down: bool,
}

/// The coordinates that belong to a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotFrames {
    /// Those of the file.
    pub own: RobotFrame,
    /// Those of Valetudo, for the formats of robots that it supports.
    pub valetudo: Option<RobotFrame>,
}

impl RobotFrame {
    /// The map's own frame.
    pub const MAP: RobotFrame = RobotFrame { units_per_m: 1.0, origin: [0.0; 2], is_y_down: false };

    /// Millimetres, y up.
    pub const fn millimetres(origin: [f64; 2]) -> RobotFrame {
        RobotFrame { units_per_m: 1000.0, origin, is_y_down: false }
    }

    fn signs(&self) -> [f64; 2] {
        [1.0, if self.is_y_down { -1.0 } else { 1.0 }]
    }

    /// Returns the robot's coordinates of a point of the map, not rounded.
    pub fn from_map(&self, point_m: [f64; 2]) -> [f64; 2] {
        let signs = self.signs();
        [0, 1].map(|axis| self.origin[axis] + signs[axis] * self.units_per_m * point_m[axis])
    }

    /// Returns the point of the map, in metres, for coordinates of the robot.
    pub fn to_map(&self, at: [f64; 2]) -> [f64; 2] {
        let signs = self.signs();
        [0, 1].map(|axis| signs[axis] * (at[axis] - self.origin[axis]) / self.units_per_m)
    }

    /// Returns the coordinates as robots take them: whole millimetres or centimetres, or metres to a millimetre.
    pub fn rounded(&self, point_m: [f64; 2]) -> [f64; 2] {
        let step = if self.units_per_m > 1.0 { 1.0 } else { 1e3 };
        // Adding zero makes -0 and 0 equal.
        self.from_map(point_m).map(|value| (value * step).round() / step + 0.0)
    }

    /// Returns the unit's symbol.
    pub fn unit(&self) -> &'static str {
        match self.units_per_m {
            1000.0 => "mm",
            100.0 => "cm",
            _ => "m",
        }
    }
}

impl Default for RobotFrames {
    fn default() -> RobotFrames {
        RobotFrames { own: RobotFrame::MAP, valetudo: None }
    }
}
