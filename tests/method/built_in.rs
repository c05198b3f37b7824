//! The surface network in the program: used with nothing installed, replaced by a file, switched off by a word.

use crate::runtimes::{built_in_labels, fixture};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;
use viola_align::AlignParams;
use viola_geometry::Point3;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::labels::{self, Truth};
use viola_lab::simulate::{ClipParams, Home, HomeParams, Set};
use viola_testing::process::viola;
use viola_testing::{room, zips};

/// Aligns the furnished room with more arguments; its results are in `folder/out`.
fn align(folder: &Path, arguments: &[&str]) -> Output {
    let (clip, lidar) = (folder.join("clip.zip"), folder.join("map.csv"));
    fs::write(&clip, zips::zip(&room::clip(12))).unwrap();
    fs::write(&lidar, room::lidar_csv()).unwrap();
    let mut command = viola();
    command.arg("align").arg("--clip").arg(clip).arg("--lidar").arg(lidar);
    command.arg("--out").arg(folder.join("out")).args(arguments).output().unwrap()
}

/// Returns what labelled the room, and its labelled cloud.
fn labelled(arguments: &[&str]) -> (String, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let output = align(folder.path(), arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let out = folder.path().join("out");
    let result: Value = serde_json::from_slice(&fs::read(out.join("result.json")).unwrap()).unwrap();
    let by = result["labels"]["by"].as_str().unwrap().to_owned();
    (by, fs::read(out.join("cloud.ply")).unwrap())
}

/// Returns a models folder whose surface network is `bytes`.
fn models_with(bytes: &[u8]) -> tempfile::TempDir {
    let models = tempfile::tempdir().unwrap();
    fs::create_dir(models.path().join("columns")).unwrap();
    fs::write(models.path().join("columns/columns.onnx"), bytes).unwrap();
    models
}

#[test]
fn surfaces_are_labelled_with_nothing_installed() {
    let (by, cloud) = labelled(&[]);
    assert!(by.starts_with("columns, "), "{by}");
    let (off, by_geometry) = labelled(&["--models", "none"]);
    assert_eq!(off, "geometry");
    assert_ne!(cloud, by_geometry);

    // A folder without networks changes nothing; a file in it replaces the built-in weights.
    let empty = tempfile::tempdir().unwrap();
    assert_eq!(labelled(&["--models", empty.path().to_str().unwrap()]).1, cloud);
    let own = models_with(&fs::read(fixture("columns.onnx")).unwrap());
    let (by, other) = labelled(&["--models", own.path().to_str().unwrap()]);
    assert!(by.starts_with("columns, "), "{by}");
    assert_ne!(other, cloud);
}

#[test]
fn other_files_in_the_place_of_the_built_in_weights_are_refused() {
    let whole = fs::read(fixture("columns.onnx")).unwrap();
    for (bytes, told) in [
        (&whole[..whole.len() / 2], "not an ONNX model"),
        (b"", "it is empty"),
        (&fs::read(fixture("segformer.onnx")).unwrap(), "it has no input grid"),
    ] {
        let (folder, models) = (tempfile::tempdir().unwrap(), models_with(bytes));
        let output = align(folder.path(), &["--models", models.path().to_str().unwrap()]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && said.contains("columns") && said.contains(told),
            "{told}: {said}"
        );
    }
}

#[test]
fn the_list_shows_it_as_built_in() {
    let folder = tempfile::tempdir().unwrap();
    let list = |models: &str| viola().args(["models", "list", "--models", models]).output().unwrap();
    let output = list(folder.path().to_str().unwrap());
    let said = String::from_utf8(output.stdout).unwrap();
    let row = said.lines().find(|line| line.starts_with("columns ")).unwrap();
    assert!(row.contains("built in") && row.contains("surface"), "{row}");
    let refused = list("none");
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && said.contains("--models DIR"), "{said}");
}

/// The rows that `viola evaluate --labels` writes without a models folder.
#[test]
fn the_evaluation_of_labels_has_a_row_for_the_volume() {
    let home = Home::generate(&HomeParams::new(Set::Normal, 3));
    let clip = home.clip(&home.survey(), 0, &ClipParams { frames: 6, ..ClipParams::default() }).into_clip();
    let params = AlignParams { label: built_in_labels(), ..AlignParams::default() };
    let truth = Truth { vertices_m: vec![Point3::origin()], classes: vec![Some(0)] };
    let rows = labels::evaluate(&clip, &truth, None, &params, &|_| Box::new(Silent)).unwrap();
    let variants: Vec<&str> = rows.iter().map(|row| row.variant.as_str()).collect();
    assert_eq!(variants, ["geometry", "volume"]);
}
