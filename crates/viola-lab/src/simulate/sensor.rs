//! Error models of depth sensors.

mod noise;
mod phone;
mod structured;

use super::echo::Shot;
use super::optics::Sight;
use serde::Serialize;
use std::str::FromStr;
use viola_formats::clip::DepthImage;
use viola_geometry::Pinhole;

/// A kind of depth sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensor {
    /// A phone's processed LiDAR: 256x192, up to 5 m, noise of about 1 % that varies slowly over the picture,
    /// edges smeared over a pixel, millimetres; no readings of low confidence (edges, far, dark, shiny).
    PhoneLidar,
    /// A structured-light camera: 640x480, 0.5 to 4.5 m, noise and quantisation that grow with the square of
    /// the distance; a distortion of up to a few percent that is fixed in a clip; holes at edges and borders, at
    /// grazing angles, on dark and shiny surfaces, and in the projector's shadow.
    StructuredLight,
}

impl FromStr for Sensor {
    type Err = String;

    fn from_str(text: &str) -> Result<Sensor, String> {
        match text {
            "phone-lidar" => Ok(Sensor::PhoneLidar),
            "structured-light" => Ok(Sensor::StructuredLight),
            _ => Err(format!("no sensor is called {text:?}; there are phone-lidar and structured-light")),
        }
    }
}

impl Sensor {
    pub fn depth_camera(self) -> Pinhole {
        match self {
            Sensor::PhoneLidar => {
                Pinhole { width: 256, height: 192, fx: 193.1, fy: 193.1, cx: 127.8, cy: 95.1 }
            }
            Sensor::StructuredLight => {
                Pinhole { width: 640, height: 480, fx: 577.6, fy: 577.6, cx: 318.9, cy: 242.7 }
            }
        }
    }

    /// Returns the maximum range, in metres.
    pub fn range_m(self) -> f64 {
        match self {
            Sensor::PhoneLidar => 5.0,
            Sensor::StructuredLight => 4.5,
        }
    }

    /// Returns the measured depth of a picture.
    pub(super) fn measure(self, shot: &Shot, sight: &Sight) -> DepthImage {
        let echoes = shot.echoes(self, sight);
        let depth_m = match self {
            Sensor::PhoneLidar => phone::measure(shot, &echoes),
            Sensor::StructuredLight => structured::measure(shot, &echoes),
        };
        let depth_m = depth_m.into_iter().map(|depth| (depth * 1000.0).round() / 1000.0).collect();
        DepthImage { width: shot.camera.width, height: shot.camera.height, depth_m }
    }
}
