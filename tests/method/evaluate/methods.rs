//! Every method on clips drawn inside a flat.

use super::flat;
use viola_align::AlignParams;
use viola_lab::evaluate::{ClipResult, DrawnClips, DrawnError, DrawnParams, Method, MethodKind};
use viola_lab::paper::{PaperParams, Refiner};

fn results(drawn: DrawnParams, methods: &[Method], workers: usize) -> Vec<ClipResult> {
    let folder = tempfile::tempdir().unwrap();
    let suite = DrawnClips::open(&[flat::write(folder.path())], drawn).unwrap();
    super::run(&suite, methods, workers)
}

/// Returns the paper's method with its constants on a coarser raster, so that the test is quick.
fn paper(refiner: Refiner) -> Method {
    let params = PaperParams { refiner, cell_m: 0.03, rotations: 180, ..PaperParams::default() };
    Method { name: format!("{refiner:?}"), kind: MethodKind::Paper(params), by_truth: false }
}

#[test]
fn all_find_clips_that_show_enough() {
    let methods = [Method::viola(AlignParams::default()), paper(Refiner::Chamfer), paper(Refiner::Icp)];
    let drawn = DrawnParams { clips: 3, outliers: 0.05, ..DrawnParams::default() };
    let results = results(drawn, &methods, 2);
    assert_eq!(results.len(), 9);
    for result in &results {
        assert!(result.is_success(), "{result:?}");
        assert!(result.coverage.is_some_and(|coverage| coverage > 0.2), "{result:?}");
    }
    for chamfer in results.iter().filter(|r| r.method == "Chamfer") {
        // Adam's last steps are a centimetre; the noise of a hundred hits averages out.
        assert!(chamfer.translation_error_m.unwrap() < 0.05, "{chamfer:?}");
    }
}

#[test]
fn drawn_clips_have_the_truth_that_they_claim() {
    // Without noise and outliers only the raster separates the answer from the truth.
    let drawn = DrawnParams { clips: 6, outliers: 0.0, noise_m: 0.0, ..DrawnParams::default() };
    for result in results(drawn, &[Method::viola(AlignParams::default())], 1) {
        assert!(result.translation_error_m.unwrap() < 0.03, "{result:?}");
        assert!(result.rotation_error_deg.unwrap() < 0.5, "{result:?}");
        assert!(result.inliers.unwrap() > 0.99, "{result:?}");
    }
}

#[test]
fn workers_change_nothing_but_the_time() {
    let run = |workers| {
        let drawn = DrawnParams { clips: 5, frames: vec![20, 40], ..DrawnParams::default() };
        let mut results = results(drawn, &[Method::viola(AlignParams::default())], workers);
        results.iter_mut().for_each(|r| (r.register_seconds, r.seconds) = (0.0, 0.0));
        results
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn maps_without_free_cells_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    std::fs::write(&path, "x_m,y_m\n0,0\n1,0\n").unwrap();
    let refused = DrawnClips::open(&[path], DrawnParams::default());
    assert!(matches!(refused, Err(DrawnError::NoCells { .. })));
}
