//! MI-GAN and FastDepth themselves, if they were fetched.

use super::rectangle;
use crate::runtimes::runtimes;
use image::{Rgb, RgbImage};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Instant;
use viola_align::complete::inpaint::{InpaintError, open_inpainter};
use viola_align::complete::monocular::open_estimator;
use viola_network as network;
use viola_network::RuntimeParams;
use viola_network::manifest::{Manifest, ModelEntry};
use viola_testing::skipped;

/// Returns the folder and the built-in entry of a network; skips with `None` if nothing was fetched.
fn fetched(name: &str) -> Option<(PathBuf, ModelEntry)> {
    let Some(models) = std::env::var_os("VIOLA_FETCHED_MODELS").map(PathBuf::from) else {
        skipped(name, "set VIOLA_FETCHED_MODELS to a models folder with it");
        return None;
    };
    let entry = Manifest::built_in().unwrap().find(name).unwrap().clone();
    let path = entry.path(&models);
    assert!(path.is_file(), "VIOLA_FETCHED_MODELS is set but {} is not there", path.display());
    Some((models, entry))
}

/// Returns a picture of a wall and a floor, in colours that change slowly.
fn room(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let shade = (x * 20 / width) as u8;
        if y < height * 5 / 8 { Rgb([190 + shade, 180 + shade, 165]) } else { Rgb([130, 95 + shade, 65]) }
    })
}

#[test]
fn migan_fills_a_hole_from_its_surroundings() {
    let Some((models, entry)) = fetched("migan") else { return };
    let (width, height) = (512, 384);
    let hole = rectangle((width, height), 200..300, 120..260);
    let mut picture = room(width, height);
    for (pixel, hole) in picture.pixels_mut().zip(hole.pixels()) {
        if hole.0 == [255] {
            *pixel = Rgb([0, 0, 255]);
        }
    }
    let mut results = Vec::new();
    for params in runtimes() {
        let inpainter = open_inpainter(&entry, &models, &params).unwrap();
        let start = Instant::now();
        let filled = inpainter.inpaint(&picture, &hole, 1, &|| true).unwrap();
        println!("{}: {} ms for {width} x {height}", inpainter.name(), start.elapsed().as_millis());
        assert!(
            filled == inpainter.inpaint(&picture, &hole, 2, &|| true).unwrap(),
            "it differs from run to run"
        );
        for threads in [1, 3] {
            let params = RuntimeParams { threads: NonZeroUsize::new(threads), ..params.clone() };
            let other = open_inpainter(&entry, &models, &params).unwrap();
            let again = other.inpaint(&picture, &hole, 1, &|| true).unwrap();
            assert!(filled == again, "{}: {threads} threads give another picture", other.name());
        }
        let wanted = room(width, height);
        let (mut inside, mut off) = (0u32, [0u32; 3]);
        for (x, y, pixel) in filled.enumerate_pixels() {
            if hole.get_pixel(x, y).0 == [0] {
                assert_eq!(pixel, picture.get_pixel(x, y), "{x}, {y} is outside the hole");
                continue;
            }
            inside += 1;
            for (sum, (got, want)) in off.iter_mut().zip(pixel.0.iter().zip(wanted.get_pixel(x, y).0)) {
                *sum += u32::from(got.abs_diff(want));
            }
        }
        let mean = off.map(|sum| f64::from(sum) / f64::from(inside));
        println!("{}: {mean:.1?} grey levels off the room behind the hole", inpainter.name());
        // The colour that was in the hole is off by 200, 180 and 100.
        assert!(mean.iter().all(|levels| *levels < 25.0), "{mean:?}");
        results.push(filled);
    }
    if let [a, b] = results.as_slice() {
        let levels = a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        println!("the runtimes differ by up to {levels} grey levels");
        assert!(levels <= 4, "{levels}");
    }
}

#[test]
fn migan_that_is_cut_off_is_refused() {
    let Some((models, entry)) = fetched("migan") else { return };
    let whole = std::fs::read(entry.path(&models)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = entry.path(folder.path());
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    for params in runtimes() {
        for eighths in [1, 4, 7] {
            std::fs::write(&path, &whole[..whole.len() / 8 * eighths]).unwrap();
            match open_inpainter(&entry, folder.path(), &params) {
                Err(InpaintError::Open(_)) => {}
                Err(error) => panic!("{eighths} eighths: {error}"),
                Ok(_) => panic!("{eighths} eighths: taken"),
            }
        }
    }
}

#[test]
fn fastdepth_goes_with_measured_depth() {
    let Some((models, entry)) = fetched("fastdepth") else { return };
    let Some(scene) = viola_testing::data::folder("scannet/scene0000_00") else { return };
    let picture = image::open(scene.join("color/100.jpg")).unwrap().into_rgb8();
    let measured = image::open(scene.join("depth/100.png")).unwrap().into_luma16();
    let mut results = Vec::new();
    for params in runtimes() {
        let network = network::open(&entry.path(&models), &params).unwrap();
        let estimator = open_estimator(&entry, network).unwrap();
        let start = Instant::now();
        let depth = estimator.depth(&picture).unwrap();
        let (width, height) = picture.dimensions();
        println!("{}: {} ms for {width} x {height}", estimator.name(), start.elapsed().as_millis());
        assert_eq!(depth.len(), (width * height) as usize);
        assert!(depth.iter().all(|d| d.is_finite() && *d > 0.0));
        // Both cameras see the same, at different resolutions.
        let pairs: Vec<(f64, f64)> = measured
            .enumerate_pixels()
            .filter(|(_, _, value)| value.0[0] > 0)
            .map(|(x, y, value)| {
                let at = (y * height / measured.height() * width) + x * width / measured.width();
                (f64::from(depth[at as usize]), f64::from(value.0[0]) / 1000.0)
            })
            .collect();
        let r = correlation(&pairs);
        println!("{}: correlation {r:.3} with the measured depth", estimator.name());
        assert!(r > 0.5, "{r}");
        results.push(depth);
    }
    if let [a, b] = results.as_slice() {
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("the runtimes differ by up to {worst:.1e} m");
        assert!(worst < 1e-3, "{worst}");
    }
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (a, b) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| of(p.0 - a, p.1 - b)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}
