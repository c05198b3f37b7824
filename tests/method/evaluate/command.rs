//! The command and the files that it writes.

use super::flat;
use serde_json::json;
use viola_testing::process::viola;

#[test]
fn leaves_tables_that_programs_can_read() {
    let folder = tempfile::tempdir().unwrap();
    let (map, out) = (flat::write(folder.path()), folder.path().join("out"));
    let evaluate = || {
        let mut command = viola();
        command.arg("evaluate").arg("--map").arg(&map).arg("--out").arg(&out);
        let done =
            command.args(["--clips", "2", "--frames", "20,30", "--methods", "viola"]).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    };
    let printed = evaluate();
    assert!(printed.contains("| flat | 20 | 2 | viola |"), "{printed}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let table: serde_json::Value = serde_json::from_str(&read("table.json")).unwrap();
    let rows = table.as_array().unwrap();
    assert_eq!(rows.len(), 2);
    // Members that other programs rely on.
    for member in [
        "method",
        "set",
        "frames",
        "clips",
        "r_mean_deg",
        "r_median_deg",
        "t_mean_m",
        "t_median_m",
        "success_rate",
        "wrong_when_aligned",
        "aligned_rate",
        "seconds_median",
    ] {
        assert!(rows[0].get(member).is_some(), "{member} is missing in {}", rows[0]);
    }
    assert_eq!(read("clips.csv").lines().count(), 5);
    let run: serde_json::Value = serde_json::from_str(&read("run.json")).unwrap();
    assert!(run["peak_memory_bytes"].as_u64().is_none_or(|bytes| bytes > 1 << 20), "{run}");
    let command = run["command"].as_str().unwrap();
    assert!(command.starts_with("viola evaluate --map ") && command.ends_with("--methods viola"), "{run}");
    let told = ["sets", "clips", "foreign", "rescale", "clips_without_true_pose"].map(|member| &run[member]);
    assert_eq!(told, [&json!([]), &json!(2), &json!(false), &json!(false), &json!(0)], "{run}");
    assert!(run["commit"].is_string() && run["seeds"].is_string() && run["drift"].is_number(), "{run}");
    assert!(read("coverage.svg").starts_with("<svg"));
    assert_eq!(run["labels_by"], serde_json::Value::Null, "drawn clips have no labels: {run}");
    // The second run takes all results from the journal, including the times. Its own memory says nothing about them.
    let csv = read("clips.csv");
    let printed = evaluate();
    assert_eq!(read("clips.csv"), csv);
    let run: serde_json::Value = serde_json::from_str(&read("run.json")).unwrap();
    let told = ["peak_memory_bytes", "clips_at_a_time"].map(|member| &run[member]);
    assert_eq!(told, [&serde_json::Value::Null; 2], "{run}");
    assert!(!printed.contains("Peak memory"), "{printed}");
}

#[test]
fn options_without_an_effect_are_wrong_arguments() {
    for (arguments, option) in [
        (&["--track", "--scene", "missing", "--frames", "60"][..], "--frames"),
        (&["--home", "--set", "normal", "--methods", "viola"], "--methods"),
        (&["--scene", "missing", "--foreign"], "--foreign"),
        (&["--set", "normal", "--frames", "0"], "--frames"),
        (&["--set", "normal", "--clips", "0"], "--clips"),
        (&["--set", "normal", "--drift", "nan"], "--drift"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let done = viola().arg("evaluate").args(arguments).arg("--out").arg(folder.path()).output().unwrap();
        let told = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.code() == Some(2) && told.contains(option), "{arguments:?}: {told}");
    }
}

#[test]
fn wants_one_source_and_known_methods() {
    for arguments in [
        &["--methods", "viola"][..],
        &["--map", "a.yaml", "--set", "normal"],
        &["--map", "missing.yaml", "--methods", "luck"],
        &["--map", "missing.yaml"],
    ] {
        let folder = tempfile::tempdir().unwrap();
        let done = viola().arg("evaluate").args(arguments).arg("--out").arg(folder.path()).output().unwrap();
        assert!(!done.status.success(), "{arguments:?}");
    }
}
