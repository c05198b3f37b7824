//! Measured sizes of household things: the 10th and 90th percentiles of about 1 600 models in the asset
//! database of ProcTHOR (Deitke et al., 2022), which are modelled after real products. Kitchen and bathroom
//! appliances are standardised and have their sizes where they are built.

use crate::simulate::rng::Rng;

/// Ranges of a kind of thing, in metres.
pub struct Sizes {
    pub width_m: [f64; 2],
    pub depth_m: [f64; 2],
    pub height_m: [f64; 2],
}

const fn sizes(width_m: [f64; 2], depth_m: [f64; 2], height_m: [f64; 2]) -> Sizes {
    Sizes { width_m, depth_m, height_m }
}

pub const ARMCHAIR: Sizes = sizes([0.70, 1.05], [0.70, 1.00], [0.69, 1.10]);
pub const BOOK: Sizes = sizes([0.15, 0.28], [0.20, 0.30], [0.02, 0.04]);
pub const BOX: Sizes = sizes([0.30, 0.57], [0.31, 0.50], [0.18, 0.35]);
pub const CHAIR: Sizes = sizes([0.40, 0.58], [0.42, 0.60], [0.79, 1.07]);
pub const COFFEE_TABLE: Sizes = sizes([0.79, 1.55], [0.50, 0.98], [0.30, 0.54]);
pub const DESK: Sizes = sizes([1.01, 2.04], [0.48, 0.90], [0.70, 0.80]);
pub const DRESSER: Sizes = sizes([0.77, 1.80], [0.36, 0.60], [0.70, 1.23]);
pub const FLOOR_LAMP: Sizes = sizes([0.40, 0.57], [0.40, 0.60], [1.45, 2.00]);
pub const LAPTOP: Sizes = sizes([0.30, 0.40], [0.22, 0.28], [0.20, 0.26]);
pub const PAINTING: Sizes = sizes([0.30, 1.10], [0.02, 0.03], [0.30, 0.85]);
pub const PILLOW: Sizes = sizes([0.37, 0.60], [0.25, 0.51], [0.11, 0.19]);
pub const PLANT: Sizes = sizes([0.23, 0.53], [0.25, 0.53], [0.47, 1.50]);
pub const POUF: Sizes = sizes([0.35, 0.86], [0.35, 0.85], [0.38, 0.48]);
pub const SHELVING: Sizes = sizes([0.50, 1.20], [0.20, 0.48], [0.66, 2.20]);
pub const SIDE_TABLE: Sizes = sizes([0.36, 0.65], [0.32, 0.55], [0.45, 0.70]);
pub const SOFA: Sizes = sizes([1.45, 2.60], [0.80, 1.10], [0.72, 1.05]);
pub const STOOL: Sizes = sizes([0.31, 0.46], [0.29, 0.46], [0.44, 0.78]);
pub const TELEVISION: Sizes = sizes([0.70, 1.45], [0.04, 0.08], [0.42, 0.82]);
pub const TRASH_BIN: Sizes = sizes([0.22, 0.45], [0.22, 0.40], [0.28, 0.66]);
pub const TV_STAND: Sizes = sizes([1.01, 1.90], [0.36, 0.50], [0.30, 0.65]);

impl Sizes {
    /// Returns a random width, depth and height.
    pub fn draw(&self, rng: &mut Rng) -> [f64; 3] {
        [rng.within(self.width_m), rng.within(self.depth_m), rng.within(self.height_m)]
    }
}
