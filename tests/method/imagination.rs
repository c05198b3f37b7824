//! Inpainting and monocular depth: small networks of tests/models under each runtime against results of
//! `diffusers`, and the real networks if they were fetched.
//!
//! `models/export/tiny_stable_diffusion.py` and `tiny_imagination.py` make the fixtures. The real networks
//! run if `VIOLA_FETCHED_MODELS` names a models folder with them.

mod diffusion;
mod fetched;
mod small;

use image::{GrayImage, Luma};
use viola_network::manifest::{Manifest, ModelEntry};

/// Returns an entry as a user would write it.
fn entry(task: &str, file: &str, input: &str, output: &str) -> ModelEntry {
    let text = format!(
        "[[network]]\nname = \"tiny\"\ntask = \"{task}\"\nfile = \"{file}\"\nlicence = \"none\"\n\
         input = {{ {input} }}\noutput = {{ {output} }}\n\
         source = {{ kind = \"export\", how = \"models/export\" }}\n"
    );
    Manifest::parse(&text).unwrap().networks.remove(0)
}

/// Returns a mask with a hole over these columns and rows.
fn rectangle(size: (u32, u32), columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> GrayImage {
    GrayImage::from_fn(size.0, size.1, |x, y| {
        Luma([if columns.contains(&x) && rows.contains(&y) { 255 } else { 0 }])
    })
}
