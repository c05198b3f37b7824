//! Position of a plan's PNG in the LiDAR map.

use super::Page;
use crate::plan::model::Plan;
use serde::{Deserialize, Serialize};
use viola_geometry::Point2;

/// Longer side of the picture.
const SIDE_PX: f64 = 2000.0;
const MAX_PX_PER_MM: f64 = 12.0;

/// Size of the picture, and the pixels of the LiDAR map's points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlanImage {
    pub size_px: [u32; 2],
    /// Rows of the affine transform of (x, y, 1) in metres to pixels from the upper-left corner, y down.
    pub px_from_map: [[f64; 3]; 2],
}

impl PlanImage {
    pub fn of(plan: &Plan) -> PlanImage {
        let page = Page::of(plan);
        let px_per_mm = px_per_mm(&page);
        let plan_from_map = plan.map_from_plan.inverse();
        let pixel = |x: f64, y: f64| {
            let at = plan_from_map.apply(&Point2::new(x, y));
            page.place([at.x, at.y]).map(|mm| mm * px_per_mm)
        };
        let (zero, right, up) = (pixel(0.0, 0.0), pixel(1.0, 0.0), pixel(0.0, 1.0));
        let px_from_map = [0, 1].map(|axis| [right[axis] - zero[axis], up[axis] - zero[axis], zero[axis]]);
        // The page has a millimetre's tenths; the renderer adds the last part of a pixel.
        let pixels = |mm: f64| ((mm * 10.0).round() / 10.0 * px_per_mm - 1e-3).ceil() as u32;
        PlanImage { size_px: [pixels(page.width_mm), pixels(page.height_mm)], px_from_map }
    }

    /// Returns the image of `plan.json`; `None` for files of earlier versions.
    pub fn in_plan_json(json: &[u8]) -> Option<PlanImage> {
        #[derive(Deserialize)]
        struct PlanFile {
            image: PlanImage,
        }
        serde_json::from_slice(json).ok().map(|file: PlanFile| file.image)
    }

    /// Returns the pixel of a point of the LiDAR map.
    pub fn pixel(&self, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        self.px_from_map.map(|[x, y, offset]| x * x_m + y * y_m + offset)
    }
}

pub fn px_per_mm(page: &Page) -> f64 {
    (SIDE_PX / page.width_mm.max(page.height_mm)).min(MAX_PX_PER_MM)
}
