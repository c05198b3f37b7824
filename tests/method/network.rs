//! Networks under each runtime, against the library that the networks come from.
//!
//! `models/export/tiny.py` makes the fixtures. ONNX Runtime is tested if `ORT_DYLIB_PATH` names its library,
//! the real network if `VIOLA_MODELS` names a models folder; skipped tests are listed.

use crate::runtimes::{fixture, runtimes, stripes};
use image::RgbImage;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;
use viola_geometry::taxonomy::{CLASSES, Class, ClassTable};
use viola_network as network;
use viola_network::manifest::{self, Installed, Manifest, ModelEntry, Task};
use viola_network::{Network, NetworkError, Runtime, RuntimeParams, Tensor};
use viola_reconstruct::label::{ClassMap, SegmentError, open_segmenter};

fn open(name: &str, params: &RuntimeParams) -> Arc<Network> {
    network::open(&fixture(name), params).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Returns an entry as a user would write it.
fn entry(classes: &str, input: &str, output: &str) -> ModelEntry {
    let text = format!(
        "[[network]]\nname = \"tiny\"\ntask = \"segmentation\"\nfile = \"tiny.onnx\"\nlicence = \"none\"\n\
         classes = \"{classes}\"\ninput = {{ {input} mean = [0.485, 0.456, 0.406], std = [0.229, 0.224, 0.225] }}\n\
         output = {{ {output} }}\nsource = {{ kind = \"export\", how = \"models/export/tiny.py\" }}\n"
    );
    Manifest::parse(&text).unwrap().networks.remove(0)
}

const OPEN: &str = "width = \"any\", height = \"any\",";

fn segformer() -> ModelEntry {
    entry("ade20k", OPEN, "kind = \"logits\"")
}

fn mask2former() -> ModelEntry {
    entry("coco", OPEN, "kind = \"mask2former\"")
}

/// Checks scores against the library's own at every `step`-th pixel from the first, mapped to our classes. The rest of
/// scores with a sum below one is `Other`.
fn check_scores(name: &str, entry: &ModelEntry, table: ClassTable, step: usize) {
    let text = std::fs::read(fixture("expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let list = |key: &str| -> Vec<usize> { serde_json::from_value(expected[name][key].clone()).unwrap() };
    let (picture, raster, kept) = (list("picture"), list("raster"), list("kept"));
    let bytes = std::fs::read(fixture(&format!("{name}.f32"))).unwrap();
    let scores: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    assert_eq!(scores.len(), kept.iter().product::<usize>());

    let picture = stripes(picture[0] as u32, picture[1] as u32);
    for params in runtimes() {
        let network = open(&format!("{name}.onnx"), &params);
        let segmenter = open_segmenter(entry, network).unwrap();
        let map = segmenter.segment(&picture).unwrap();
        assert_eq!((map.width, map.height), (raster[0], raster[1]), "{}", segmenter.name());
        let mut worst = 0.0f32;
        for (place, scores) in scores.chunks_exact(kept[2]).enumerate() {
            let (x, y) = (place % kept[0] * step, place / kept[0] * step);
            let total = scores.iter().sum::<f32>();
            let mut wanted = [0.0f32; CLASSES];
            wanted[Class::Other.id() as usize] = (1.0 - total).max(0.0);
            for (id, score) in scores.iter().enumerate() {
                wanted[table.fold(id).id() as usize] += score / total.max(1.0);
            }
            let got = &map.probabilities[(y * map.width + x) * CLASSES..][..CLASSES];
            for (got, wanted) in got.iter().zip(&wanted) {
                worst = worst.max((got - wanted).abs());
            }
        }
        println!("{name}, {}: largest difference {worst:.1e}", segmenter.name());
        assert!(worst <= 1e-3, "{}: {worst}", segmenter.name());
        assert!(sums_to_one(&map));
    }
}

fn sums_to_one(map: &ClassMap) -> bool {
    map.probabilities.chunks_exact(CLASSES).all(|p| (p.iter().sum::<f32>() - 1.0).abs() < 1e-4)
}

#[test]
fn segformer_is_what_transformers_says() {
    check_scores("segformer", &segformer(), ClassTable::Ade20k, 2);
}

#[test]
fn mask2former_is_what_transformers_says() {
    check_scores("mask2former", &mask2former(), ClassTable::Coco, 8);
}

#[test]
fn pictures_of_other_shapes_are_padded_and_cut() {
    let network = open("segformer.onnx", &runtimes()[0]);
    let segmenter = open_segmenter(&segformer(), network).unwrap();
    // The network's raster is 40 x 24 for 160 x 96.
    for (width, height, raster) in [
        (160, 96, (40, 24)),
        (640, 384, (40, 24)),
        (96, 96, (24, 24)),
        (97, 480, (5, 24)),
        (1000, 10, (40, 1)),
        (1, 1, (24, 24)),
    ] {
        let map = segmenter.segment(&stripes(width, height)).unwrap();
        assert_eq!((map.width, map.height), raster, "{width} x {height}");
        assert!(sums_to_one(&map));
    }
    assert_eq!(segmenter.segment(&RgbImage::new(0, 7)), Err(SegmentError::NoPicture));
}

#[test]
fn files_that_are_no_networks_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let whole = std::fs::read(fixture("segformer.onnx")).unwrap();
    let mut paths = vec![
        put("empty.onnx", b""),
        put("text.onnx", b"<html>404 not found</html>"),
        put(
            "noise.onnx",
            &(0..40_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect::<Vec<_>>(),
        ),
        folder.path().to_owned(),
        folder.path().join("nowhere.onnx"),
    ];
    for eighth in 1..8 {
        paths.push(put(&format!("cut{eighth}.onnx"), &whole[..whole.len() * eighth / 8]));
    }
    for params in runtimes() {
        for path in &paths {
            match network::open(path, &params) {
                Err(NetworkError::NotANetwork { .. } | NetworkError::Unreadable { .. }) => {}
                Err(error) => panic!("{}: {error}", path.display()),
                Ok(network) => panic!("{} opens in {}", path.display(), network.runtime()),
            }
        }
    }
}

#[test]
fn a_network_that_is_not_its_entry_is_refused() {
    let fixed = |size: &str| entry("ade20k", size, "kind = \"logits\"");
    for params in runtimes() {
        for (file, entry, told) in [
            ("segformer.onnx", entry("coco", OPEN, "kind = \"logits\""), "1x150x24x40, not 1x133x?x?"),
            ("segformer.onnx", entry("ade20k", OPEN, "kind = \"logits\", first_class = 1"), "1x151"),
            (
                "segformer.onnx",
                entry("ade20k", OPEN, "kind = \"logits\", name = \"scores\""),
                "no output scores",
            ),
            ("segformer.onnx", mask2former(), "no output class_queries_logits"),
            ("segformer.onnx", fixed("width = 513, height = 385,"), "1x3x96x160"),
            ("segformer.onnx", fixed("width = 160, height = 96, name = \"image\","), "no input image"),
            ("segformer.onnx", fixed("width = 160, height = 96, layout = \"nhwc\","), "input"),
            ("mask2former.onnx", segformer(), "2 outputs"),
            ("mask2former.onnx", entry("ade20k", OPEN, "kind = \"mask2former\""), "1x6x134, not 1x?x151"),
        ] {
            match open_segmenter(&entry, open(file, &params)) {
                Err(error @ SegmentError::Misfit { .. }) => {
                    assert!(error.to_string().contains(told), "{file}, {told}: {error}");
                }
                Err(error) => panic!("{file}, {told}: {error}"),
                Ok(_) => panic!("{file}, {told}: taken"),
            }
        }
    }
}

#[test]
fn numbers_that_are_none_are_refused() {
    for params in runtimes() {
        let segmenter = open_segmenter(&segformer(), open("nan.onnx", &params)).unwrap();
        assert_eq!(segmenter.segment(&stripes(8, 8)), Err(SegmentError::NotFinite), "{}", segmenter.name());
    }
}

#[test]
fn inputs_are_checked_before_a_run() {
    let good = || Tensor::f32([1, 3, 96, 160], vec![0.0; 3 * 96 * 160]);
    for params in runtimes() {
        let network = open("segformer.onnx", &params);
        let output = network.outputs()[0].name.clone();
        let run = |inputs: &[(&str, Tensor)], output: &str| network.run(inputs, [output]);
        let right = [("pixel_values", good())];
        assert_eq!(run(&right, &output).unwrap()[0].shape, [1, 150, 24, 40]);
        assert!(run(&right, "scores").unwrap_err().to_string().contains("the output scores is missing"));
        for (inputs, told) in [
            (vec![], "is not given"),
            (vec![("pixel_values", good()), ("more", good())], "no input more"),
            (vec![("pixel_values", good()), ("pixel_values", good())], "twice"),
            (vec![("pixel_values", Tensor::u8([1, 3, 96, 160], vec![0; 3 * 96 * 160]))], "takes F32"),
            (
                vec![("pixel_values", Tensor::f32([1, 3, 160, 96], vec![0.0; 3 * 96 * 160]))],
                "takes 1x3x96x160",
            ),
            (vec![("pixel_values", Tensor::f32([1, 3, 96, 160], vec![0.0; 5]))], "with 5 numbers"),
            (vec![("pixel_values", Tensor::f32([3, 96, 160], vec![0.0; 3 * 96 * 160]))], "takes 1x3x96x160"),
        ] {
            let error = run(&inputs, &output).expect_err(told).to_string();
            assert!(error.contains(told), "{told}: {error}");
        }
    }
}

/// The same picture gives the same answer to the last bit, for any number of threads.
#[test]
fn threads_do_not_change_the_answer() {
    for params in runtimes() {
        for (file, entry, picture) in [
            ("segformer.onnx", segformer(), stripes(160, 96)),
            ("mask2former.onnx", mask2former(), stripes(512, 512)),
        ] {
            let answer = |threads: usize| {
                let params = RuntimeParams { threads: NonZeroUsize::new(threads), ..params.clone() };
                open_segmenter(&entry, open(file, &params)).unwrap().segment(&picture).unwrap()
            };
            let one = answer(1);
            for threads in [2, 3, 7] {
                assert!(one == answer(threads), "{file}, {:?}, {threads} threads", params.runtime);
            }
        }
    }
}

#[test]
fn a_runtime_that_is_asked_for_and_not_there_is_an_error() {
    let params = |runtime, library: Option<&str>| RuntimeParams {
        runtime,
        library: library.map(PathBuf::from),
        ..RuntimeParams::default()
    };
    let on_cuda = |runtime| RuntimeParams { device: network::Device::Cuda, ..params(runtime, None) };
    for (params, told) in [
        (params(Runtime::OnnxRuntime, Some("/nowhere/libonnxruntime.so")), "cannot be read"),
        (params(Runtime::Auto, Some("/nowhere/libonnxruntime.so")), "cannot be read"),
        (on_cuda(Runtime::Rten), "rten computes on the processor only"),
    ] {
        match network::open(&fixture("segformer.onnx"), &params) {
            Ok(network) => panic!("{told}: {} runs it", network.runtime()),
            Err(error) => assert!(error.to_string().contains(told), "{told}: {error}"),
        }
    }
}

/// The real network on a real picture, if both are available.
#[test]
fn both_runtimes_see_the_same_classes() {
    let Some(models) = std::env::var_os("VIOLA_MODELS").map(PathBuf::from) else {
        viola_testing::skipped("a real network in both runtimes", "set VIOLA_MODELS to a models folder");
        return;
    };
    let Some(scene) = viola_testing::data::folder("scannet/scene0000_00") else { return };
    let Some(Installed { entry, .. }) = manifest::installed(Task::Segmentation, Some(&models)).unwrap()
    else {
        panic!("VIOLA_MODELS is set but no segmentation network is in {}", models.display());
    };
    let picture = image::open(scene.join("color/100.jpg")).unwrap().into_rgb8();
    let maps: Vec<ClassMap> = runtimes()
        .iter()
        .map(|params| {
            let network = network::open(&entry.path(&models), params).unwrap();
            let segmenter = open_segmenter(&entry, network).unwrap();
            let start = std::time::Instant::now();
            let map = segmenter.segment(&picture).unwrap();
            println!("{}: {} ms", segmenter.name(), start.elapsed().as_millis());
            assert!(sums_to_one(&map));
            for threads in [1, 2, 5] {
                let params = RuntimeParams { threads: NonZeroUsize::new(threads), ..params.clone() };
                let network = network::open(&entry.path(&models), &params).unwrap();
                let again = open_segmenter(&entry, network).unwrap().segment(&picture).unwrap();
                assert!(map == again, "{}: {threads} threads give another answer", segmenter.name());
            }
            map
        })
        .collect();
    let best = |map: &ClassMap| -> Vec<usize> {
        let best = |p: &[f32]| (0..CLASSES).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap_or_default();
        map.probabilities.chunks_exact(CLASSES).map(best).collect()
    };
    if let [a, b] = maps.as_slice() {
        let (a, b) = (best(a), best(b));
        let same = a.iter().zip(&b).filter(|(a, b)| a == b).count();
        let share = same as f64 / a.len() as f64;
        println!("the same class at {:.2} % of the pixels", 100.0 * share);
        assert!(a.len() == b.len() && share >= 0.995, "{share}");
    }
}
