//! Inputs of the tests: the runtimes of networks, the small networks in tests/models, the network in the program, and the
//! real apartment.

use image::{Rgb, RgbImage};
use std::path::{Path, PathBuf};
use viola_network::manifest::{self, Task};
use viola_network::{Runtime, RuntimeParams};
use viola_reconstruct::LabelParams;
use viola_reconstruct::label::SurfaceNetwork;

pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models").join(name)
}

/// Returns the folder of the real apartment, if there is one.
pub fn apartment() -> Option<PathBuf> {
    viola_testing::data::folder("scannet/scene0000_00")
}

/// Returns the available runtimes.
pub fn runtimes() -> Vec<RuntimeParams> {
    let rten = RuntimeParams { runtime: Runtime::Rten, ..RuntimeParams::default() };
    match std::env::var_os("ORT_DYLIB_PATH") {
        Some(path) => {
            let library = Some(PathBuf::from(path));
            vec![rten, RuntimeParams { runtime: Runtime::OnnxRuntime, library, ..RuntimeParams::default() }]
        }
        None => {
            viola_testing::skipped("ONNX Runtime", "set ORT_DYLIB_PATH to its library");
            vec![rten]
        }
    }
}

/// Returns the picture that `models/export/tiny.py` draws.
pub fn stripes(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        Rgb([0, 1, 2].map(|c| ((x * (3 + 2 * c) + y * (7 - 2 * c) + x * y / 64) % 256) as u8))
    })
}

/// Returns the labelling by the surface network in the program.
pub fn built_in_labels() -> LabelParams {
    let installed = manifest::installed(Task::Surface, None).unwrap().unwrap();
    let network = viola_network::open_weights(&installed.weights, &RuntimeParams::default()).unwrap();
    let surface = Some(SurfaceNetwork::new(&installed.entry, network).unwrap().into());
    LabelParams { surface, ..LabelParams::default() }
}
