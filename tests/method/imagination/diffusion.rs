//! Stable Diffusion with tiny random weights against `diffusers`.

use super::{entry, rectangle};
use crate::runtimes::{fixture, runtimes, stripes};
use image::RgbImage;
use std::cell::Cell;
use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use viola_align::complete::inpaint::{InpaintError, Inpainter, Noise, StableDiffusion, open_inpainter};
use viola_network::RuntimeParams;
use viola_network::manifest::ModelEntry;

const HALVES: &str = "width = \"any\", height = \"any\", mean = [0.5, 0.5, 0.5], std = [0.5, 0.5, 0.5]";

fn pipeline(output: &str) -> ModelEntry {
    let output = format!("kind = \"diffusion\", {output}");
    entry("inpainting", "stable_diffusion/pipeline.json", HALVES, &output)
}

fn open(output: &str, params: &RuntimeParams) -> StableDiffusion {
    StableDiffusion::open(&pipeline(output), &fixture(""), params).unwrap()
}

fn numbers(name: &str) -> Vec<f32> {
    let bytes = fs::read(fixture("stable_diffusion").join(name)).unwrap();
    bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

fn noise() -> Noise {
    let mut initial = numbers("noise.f32");
    let encoding = initial.split_off(initial.len() / 2);
    Noise { initial, encoding }
}

/// Returns the hole of the fixtures.
fn hole() -> image::GrayImage {
    rectangle((64, 64), 18..46, 12..40)
}

fn check(scheduler: &str) {
    let wanted = numbers(&format!("{scheduler}.f32"));
    let drawn = image::open(fixture(&format!("stable_diffusion/{scheduler}.png"))).unwrap().into_rgb8();
    for params in runtimes() {
        let network = open(&format!("steps = 20, scheduler = \"{scheduler}\""), &params);
        let made = network.generate(&stripes(64, 64), &hole(), &noise(), &|| true).unwrap();
        assert_eq!(made.latents.len(), wanted.len());
        let worst = made.latents.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let levels = made.picture.iter().zip(drawn.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        println!("{scheduler}, {}: latents to {worst:.1e}, grey levels to {levels}", network.name());
        assert!(worst <= 1e-3 && levels <= 2, "{}: {worst}, {levels}", network.name());
    }
}

#[test]
fn ddim_is_what_diffusers_makes() {
    check("ddim");
}

#[test]
fn euler_is_what_diffusers_makes() {
    check("euler");
}

/// Checks that each of these inputs has an effect, which the comparison with `diffusers` does not show.
#[test]
fn words_guidance_and_noise_count() {
    let params = &runtimes()[0];
    let latents = |output: &str, noise: &Noise| {
        open(output, params).generate(&stripes(64, 64), &hole(), noise, &|| true).unwrap().latents
    };
    let plain = latents("steps = 20", &noise());
    let swapped = Noise { initial: noise().initial, encoding: noise().initial };
    for (told, other) in [
        ("prompt", latents("steps = 20, prompt = \"of of of\"", &noise())),
        ("negative prompt", latents("steps = 20, negative_prompt = \"a photo\"", &noise())),
        ("guidance", latents("steps = 20, guidance = 3.0", &noise())),
        ("noise of the encoder", latents("steps = 20", &swapped)),
    ] {
        let worst = plain.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("another {told}: latents differ by up to {worst:.2}");
        assert!(worst > 0.05, "{told}: {worst}");
    }
}

#[test]
fn seeds_decide_and_threads_do_not() {
    let (picture, hole) = (stripes(100, 70), rectangle((100, 70), 30..60, 20..41));
    for params in runtimes() {
        let fill = |seed: u64, threads: usize| {
            let params = RuntimeParams { threads: NonZeroUsize::new(threads), ..params.clone() };
            let network = open_inpainter(&pipeline("steps = 3"), &fixture(""), &params).unwrap();
            network.inpaint(&picture, &hole, seed, &|| true).unwrap()
        };
        let first = fill(1, 1);
        for threads in [1, 2, 5] {
            assert!(first == fill(1, threads), "{:?}, {threads} threads", params.runtime);
        }
        assert!(first != fill(2, 1));
        let changed = |filled: &RgbImage| {
            filled
                .enumerate_pixels()
                .all(|(x, y, pixel)| hole.get_pixel(x, y).0 == [255] || pixel == picture.get_pixel(x, y))
        };
        assert!(changed(&first) && changed(&fill(2, 1)), "something outside the hole changed");
    }
}

#[test]
fn pictures_of_any_size_come_back_at_their_size() {
    let network = open("steps = 2, guidance = 1.0", &runtimes()[0]);
    for size in [(64, 64), (640, 480), (33, 90), (9, 200), (1, 1)] {
        let picture = stripes(size.0, size.1);
        let hole = rectangle(size, size.0 / 3..size.0, size.1 / 3..size.1);
        let filled = network.inpaint(&picture, &hole, 7, &|| true).unwrap();
        assert_eq!(filled.dimensions(), size);
    }
}

#[test]
fn noise_of_a_seed_is_normal() {
    let network = open("steps = 1", &runtimes()[0]);
    let all: Vec<f64> = (0..40)
        .flat_map(|seed| {
            let Noise { initial, encoding } = network.noise(seed);
            [initial, encoding].concat()
        })
        .map(f64::from)
        .collect();
    let moment = |power: i32| all.iter().map(|value| value.powi(power)).sum::<f64>() / all.len() as f64;
    assert!(moment(1).abs() < 0.03, "{}", moment(1));
    assert!((moment(2) - 1.0).abs() < 0.05, "{}", moment(2));
    assert!((moment(4) - 3.0).abs() < 0.3, "{}", moment(4));
}

#[test]
fn a_cancelled_run_ends_between_steps() {
    let network = open("steps = 50", &runtimes()[0]);
    let left = Cell::new(5);
    let keep_going = || {
        left.set(left.get() - 1);
        left.get() > 0
    };
    let error = network.inpaint(&stripes(64, 64), &hole(), 1, &keep_going).unwrap_err();
    assert_eq!((error, left.get()), (InpaintError::Cancelled, 0));
}

/// Returns a copy of the pipeline with a file changed by `change`.
fn changed(file: &str, change: impl Fn(&Path)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("stable_diffusion");
    fs::create_dir(&inside).unwrap();
    for name in [
        "text_encoder.onnx",
        "vae_encoder.onnx",
        "unet.onnx",
        "vae_decoder.onnx",
        "tokenizer.json",
        "pipeline.json",
    ] {
        fs::copy(fixture("stable_diffusion").join(name), inside.join(name)).unwrap();
    }
    change(&inside.join(file));
    folder
}

#[test]
fn other_pipelines_are_refused() {
    let words = |from: &'static str, to: &'static str| {
        move |path: &Path| {
            let text = fs::read_to_string(path).unwrap();
            assert!(text.contains(from), "{from}");
            fs::write(path, text.replacen(from, to, 1)).unwrap();
        }
    };
    let cut = |path: &Path| {
        let whole = fs::read(path).unwrap();
        fs::write(path, &whole[..whole.len() / 2]).unwrap();
    };
    let other = |name: &'static str| {
        move |path: &Path| {
            fs::copy(fixture(name), path).unwrap();
        }
    };
    type Change = Box<dyn Fn(&Path)>;
    let cases: Vec<(&str, Change, &str)> = vec![
        ("pipeline.json", Box::new(words("\"epsilon\"", "\"sample\"")), "unknown variant `sample`"),
        ("pipeline.json", Box::new(words("scaled_linear", "squaredcos")), "unknown variant `squaredcos`"),
        ("pipeline.json", Box::new(words("\"leading\"", "\"karras\"")), "unknown variant `karras`"),
        ("pipeline.json", Box::new(words("\"cell\"", "\"shift_factor\": 1, \"cell\"")), "shift_factor"),
        ("pipeline.json", Box::new(words("\"cell\": 8", "\"cell\": 0")), "latents.cell"),
        ("pipeline.json", Box::new(words("\"cell\": 8", "\"cell\": 4")), "vae_encoder.onnx: its output mean"),
        ("pipeline.json", Box::new(words("\"train_steps\": 1000", "\"train_steps\": 10")), "trained with 10"),
        ("pipeline.json", Box::new(cut), "EOF"),
        ("tokenizer.json", Box::new(words("\"length\":77", "\"length\":76")), "text_encoder.onnx"),
        ("tokenizer.json", Box::new(cut), "EOF"),
        ("tokenizer.json", Box::new(|path| fs::remove_file(path).unwrap()), "cannot be read"),
        ("unet.onnx", Box::new(cut), "cannot be opened"),
        ("unet.onnx", Box::new(|path| fs::remove_file(path).unwrap()), "cannot be opened"),
        ("unet.onnx", Box::new(other("segformer.onnx")), "unet.onnx: it has no input sample"),
        ("vae_decoder.onnx", Box::new(other("stable_diffusion/vae_encoder.onnx")), "no input latents"),
        ("text_encoder.onnx", Box::new(other("red.onnx")), "no input input_ids"),
    ];
    for params in runtimes() {
        for (file, change, told) in &cases {
            let models = changed(file, change);
            match open_inpainter(&pipeline("steps = 20"), models.path(), &params) {
                Err(error) => assert!(error.to_string().contains(told), "{file}, {told}: {error}"),
                Ok(_) => panic!("{file}, {told}: taken"),
            }
        }
        for (entry, told) in [
            (pipeline("prompt = \"ein geräumiges Zimmer\""), "plain ASCII"),
            (
                entry(
                    "inpainting",
                    "stable_diffusion/pipeline.json",
                    "width = 64, height = 64",
                    "kind = \"diffusion\"",
                ),
                "mean 0.5",
            ),
            (
                entry(
                    "inpainting",
                    "stable_diffusion/pipeline.json",
                    &HALVES.replace("\"any\"", "128"),
                    "kind = \"diffusion\"",
                ),
                "64x64, not 1x3x128x128",
            ),
        ] {
            let error = StableDiffusion::open(&entry, &fixture(""), &params).err().unwrap().to_string();
            assert!(error.contains(told), "{told}: {error}");
        }
    }
}

#[test]
fn numbers_that_are_none_are_refused() {
    for params in runtimes() {
        let models = changed("unet.onnx", |path| {
            fs::copy(fixture("nan_unet.onnx"), path).unwrap();
        });
        let network = StableDiffusion::open(&pipeline("steps = 2"), models.path(), &params).unwrap();
        let error = network.inpaint(&stripes(64, 64), &hole(), 1, &|| true).unwrap_err();
        assert_eq!(error, InpaintError::NotFinite, "{}", network.name());
        let short = Noise { initial: vec![0.0; 3], encoding: vec![0.0; 256] };
        let error = network.generate(&stripes(64, 64), &hole(), &short, &|| true).unwrap_err();
        assert!(matches!(error, InpaintError::Shape { .. }), "{error}");
    }
}
