//! The code around inpainting and depth networks, tested by networks without weights.

use super::{entry, rectangle};
use crate::runtimes::{fixture, runtimes, stripes};
use image::{GrayImage, RgbImage};
use std::sync::atomic::{AtomicUsize, Ordering};
use viola_align::complete::inpaint::{InpaintError, Inpainter, open_inpainter};
use viola_align::complete::monocular::{DepthError, DepthEstimator, open_estimator};
use viola_network as network;
use viola_network::RuntimeParams;
use viola_network::manifest::ModelEntry;

const OPEN: &str = "width = \"any\", height = \"any\"";

fn inpainting(file: &str) -> ModelEntry {
    entry("inpainting", file, OPEN, "kind = \"inpainting\"")
}

fn inpainter(entry: &ModelEntry, params: &RuntimeParams) -> Result<Box<dyn Inpainter>, InpaintError> {
    open_inpainter(entry, &fixture(""), params)
}

fn depth(file: &str, rest: &str) -> ModelEntry {
    entry(
        "depth",
        file,
        "width = \"any\", height = \"any\", shortest = 64",
        &format!("kind = \"depth\"{rest}"),
    )
}

fn estimator(entry: &ModelEntry, params: &RuntimeParams) -> Result<Box<dyn DepthEstimator>, DepthError> {
    open_estimator(entry, network::open(&entry.path(&fixture("")), params).unwrap())
}

#[test]
fn only_the_hole_is_filled() {
    let picture = stripes(61, 47);
    let hole = rectangle((61, 47), 20..40, 9..30);
    for params in runtimes() {
        let inpainter = inpainter(&inpainting("negative.onnx"), &params).unwrap();
        let filled = inpainter.inpaint(&picture, &hole, 1, &|| true).unwrap();
        for (x, y, pixel) in filled.enumerate_pixels() {
            let was = picture.get_pixel(x, y).0;
            let want = if hole.get_pixel(x, y).0 == [255] { was.map(|value| 255 - value) } else { was };
            assert_eq!(pixel.0, want, "{}: {x}, {y}", inpainter.name());
        }
    }
}

#[test]
fn without_a_hole_or_without_time_nothing_is_run() {
    let params = &runtimes()[0];
    // It would fail if it ran.
    let inpainter = inpainter(&inpainting("narrow.onnx"), params).unwrap();
    let (picture, none) = (stripes(8, 8), GrayImage::new(8, 8));
    assert_eq!(inpainter.inpaint(&picture, &none, 1, &|| true), Ok(picture.clone()));
    let hole = rectangle((8, 8), 2..4, 2..4);
    let asked = AtomicUsize::new(0);
    let stop = || {
        asked.fetch_add(1, Ordering::Relaxed);
        false
    };
    assert_eq!(inpainter.inpaint(&picture, &hole, 1, &stop), Err(InpaintError::Cancelled));
    assert_eq!(asked.load(Ordering::Relaxed), 1);
}

#[test]
fn inpainting_that_cannot_be_is_told() {
    let hole = || rectangle((8, 8), 2..4, 2..4);
    for params in runtimes() {
        let narrow = inpainter(&inpainting("narrow.onnx"), &params).unwrap();
        for (picture, hole, told) in [
            (stripes(8, 8), hole(), "U8 [1, 3, 8, 7] where U8 [1, 3, 8, 8]"),
            (stripes(9, 8), hole(), "the mask of the holes is 8 x 8, but the picture 9 x 8"),
            (RgbImage::new(0, 8), GrayImage::new(0, 8), "no pixels"),
        ] {
            let error = narrow.inpaint(&picture, &hole, 1, &|| true).unwrap_err().to_string();
            assert!(error.contains(told), "{told}: {error}");
        }
        for (entry, told) in [
            (inpainting("nowhere.onnx"), "cannot be opened"),
            (inpainting("expected.json"), "cannot be opened"),
            (inpainting("segformer.onnx"), "no input image"),
            (inpainting("red.onnx"), "no input mask"),
            (depth("red.onnx", ""), "not an inpainting network"),
            (
                entry("inpainting", "negative.onnx", OPEN, "kind = \"inpainting\", name = \"picture\""),
                "no output",
            ),
            (
                entry("inpainting", "negative.onnx", "width = 8, height = 8", "kind = \"inpainting\""),
                "any size",
            ),
        ] {
            match inpainter(&entry, &params) {
                Err(error) => assert!(error.to_string().contains(told), "{told}: {error}"),
                Ok(_) => panic!("{told}: taken"),
            }
        }
    }
}

/// The network returns the red channel of a picture of one colour.
#[test]
fn depth_is_of_the_pictures_size_and_grows_with_depth() {
    for params in runtimes() {
        for (rest, want) in [("", 0.4), (", scale = 2.0", 0.8), (", inverse = true", 2.5)] {
            let estimator = estimator(&depth("red.onnx", rest), &params).unwrap();
            for (width, height) in [(64, 64), (100, 75), (7, 300), (1, 1)] {
                let picture = RgbImage::from_pixel(width, height, image::Rgb([102, 7, 9]));
                let depth = estimator.depth(&picture).unwrap();
                assert_eq!(depth.len(), (width * height) as usize);
                assert!(depth.iter().all(|d| (d - want).abs() < 1e-3), "{rest}: {depth:?}");
            }
            assert_eq!(estimator.depth(&RgbImage::new(0, 3)), Err(DepthError::NoPicture));
        }
    }
}

#[test]
fn depth_that_cannot_be_is_told() {
    for params in runtimes() {
        let nan = estimator(&depth("nan_depth.onnx", ""), &params).unwrap();
        assert_eq!(nan.depth(&stripes(64, 64)), Err(DepthError::NotFinite));
        let black = estimator(&depth("red.onnx", ""), &params).unwrap();
        assert_eq!(black.depth(&RgbImage::new(64, 64)), Err(DepthError::NotPositive));
        for (entry, told) in [
            (depth("segformer.onnx", ""), "1x150x24x40, not 1x1x?x?"),
            (depth("negative.onnx", ""), "2 inputs"),
            (depth("red.onnx", ", name = \"far\""), "no output far"),
            (inpainting("negative.onnx"), "not a depth network"),
        ] {
            match estimator(&entry, &params) {
                Err(error @ DepthError::Misfit { .. }) => {
                    assert!(error.to_string().contains(told), "{told}: {error}");
                }
                Err(error) => panic!("{told}: {error}"),
                Ok(_) => panic!("{told}: taken"),
            }
        }
    }
}
