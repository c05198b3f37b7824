//! `viola map`: the map of a whole home without a server, of a simulated home.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::LazyLock;
use tempfile::TempDir;
use viola_formats::container;
use viola_geometry::taxonomy::Class;
use viola_lab::simulate::{ClipParams, Home, HomeParams, Sensor, Set, valetudo_json, write_scannet_zip};
use viola_testing::eventually;
use viola_testing::process::{Process, viola};
use viola_testing::zips;

const CLIPS: u64 = 3;
const FILES: [&str; 20] = [
    "calibration.json",
    "home.mcap",
    "map.json",
    "matter.json",
    "mesh.glb",
    "mesh.obj",
    "mesh.usdz",
    "nav2.zip",
    "objects.json",
    "plan.dxf",
    "plan.geojson",
    "plan.json",
    "plan.pdf",
    "plan.png",
    "plan.svg",
    "points.e57",
    "points.laz",
    "points.ply",
    "rooms.json",
    "valetudo.json",
];

/// A simulated home: clips that can be aligned, and one that is no clip.
struct Recorded {
    folder: TempDir,
    clips: Vec<PathBuf>,
    broken: PathBuf,
    lidar: PathBuf,
}

static RECORDED: LazyLock<Recorded> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let home = Home::generate(&HomeParams::new(Set::Normal, 2));
    let survey = home.survey();
    let color_width = Sensor::PhoneLidar.depth_camera().width;
    let params = ClipParams { frames: 24, color_width, ..ClipParams::default() };
    let record = |index: u64| {
        let path = folder.path().join(format!("clip_{index}.zip"));
        write_scannet_zip(&home.clip(&survey, index, &params), fs::File::create(&path).unwrap()).unwrap();
        path
    };
    let clips = (0..CLIPS).map(record).collect();
    let (broken, lidar) = (folder.path().join("broken.zip"), folder.path().join("valetudo.json"));
    fs::write(&broken, "this is no clip").unwrap();
    fs::write(&lidar, valetudo_json(&survey).to_string()).unwrap();
    Recorded { folder, clips, broken, lidar }
});

/// Maps the home with one thread, the broken clip first.
static MAPPED: LazyLock<(BTreeMap<String, Vec<u8>>, Output)> = LazyLock::new(|| {
    let Recorded { clips, broken, lidar, .. } = &*RECORDED;
    let out = tempfile::tempdir().unwrap();
    let all: Vec<&Path> = [broken].into_iter().chain(clips).map(PathBuf::as_path).collect();
    let output = map(&all, lidar, out.path(), 1);
    (files(out.path()), output)
});

fn map(clips: &[&Path], lidar: &Path, out: &Path, threads: usize) -> Output {
    let mut command = viola();
    command.arg("map").args(clips).arg("--lidar").arg(lidar).arg("--out").arg(out);
    command.env("RAYON_NUM_THREADS", threads.to_string()).output().unwrap()
}

/// Returns everything in a folder by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries.map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap())).collect()
}

fn document(name: &str) -> Value {
    serde_json::from_slice(&MAPPED.0[name]).unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_clip_that_fails_does_not_stop_the_others() {
    let (files, output) = &*MAPPED;
    let (told, table) = (text(&output.stderr), text(&output.stdout));
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert_eq!(files.keys().map(String::as_str).collect::<Vec<_>>(), FILES);
    let map = document("map.json");
    let clips = map["clips"].as_array().unwrap();
    assert_eq!(clips.len(), CLIPS as usize + 1);
    let (broken, good) = clips.split_last().unwrap();
    assert_eq!(broken["file"], RECORDED.broken.to_str().unwrap());
    assert_eq!((&broken["state"], &broken["by"]), (&json!("failed"), &Value::Null));
    assert_eq!((&broken["map_from_clip"], &broken["probability"]), (&Value::Null, &Value::Null));
    assert_eq!(broken["reasons"][0]["code"], "unknown_layout");
    for clip in good {
        assert_eq!((&clip["state"], &clip["by"]), (&json!("aligned"), &json!("alignment")), "{clip:#}");
        assert!(clip["probability"].as_f64().unwrap() > 0.9 && clip["points"].as_u64().unwrap() > 1000);
        assert!(clip["map_from_clip"]["yaw_rad"].is_f64());
    }
    let points = map["info"]["points"].as_u64().unwrap();
    assert!(text(&files["points.ply"][..400]).contains(&format!("element vertex {points}")));
    assert!(files["plan.png"].starts_with(b"\x89PNG") && files["plan.svg"].starts_with(b"<svg"));
    assert_eq!(document("plan.geojson")["type"], "FeatureCollection");
    assert!(files["mesh.glb"].starts_with(b"glTF") && files["mesh.usdz"].starts_with(b"PK"));
    assert!(text(&files["mesh.obj"]).contains("\ng floor\n"));
    // Progress goes to stderr, without percentages since it is no terminal; stdout has the results only.
    assert!(told.contains("clip 4 of 4: fuse") && !told.contains('%'), "{told}");
    assert!(told.contains("clip 1 of 4: failed: ") && told.contains("(unknown_layout)"), "{told}");
    assert!(table.starts_with("clip ") && table.contains("3 of 4 in the map"), "{table}");
    let absent = table.lines().find(|line| line.contains("broken.zip: failed: ")).unwrap();
    assert!(absent.ends_with(" (unknown_layout)"), "{absent}");
    assert!(told.contains("map: 3 of 4 clips are in the map"), "{told}");
    assert!(!table.contains("clip 1 of 4"), "{table}");
}

#[test]
fn neither_order_nor_threads_change_a_byte() {
    let Recorded { clips, broken, lidar, .. } = &*RECORDED;
    let out = tempfile::tempdir().unwrap();
    // One clip twice: it counts once.
    let all: Vec<&Path> = [&clips[2], broken, &clips[1], &clips[2], &clips[0]].map(PathBuf::as_path).to_vec();
    let output = map(&all, lidar, out.path(), 3);
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
    let again = files(out.path());
    for name in FILES {
        assert_eq!(again[name], MAPPED.0[name], "{name}");
    }
    assert_eq!(output.stdout.len(), MAPPED.1.stdout.len());
}

#[test]
fn a_clip_in_another_archive_counts_once() {
    let Recorded { clips, lidar, .. } = &*RECORDED;
    let recorded = container::open(&clips[0]).unwrap();
    let mut packed: zips::Files = Vec::new();
    for name in recorded.names().iter().rev() {
        packed.push((format!("again/{name}"), recorded.read(name, 1 << 30).unwrap()));
    }
    let folder = tempfile::tempdir().unwrap();
    let again = folder.path().join("again.zip");
    fs::write(&again, zips::zip(&packed)).unwrap();
    check_one_clip(&clips[0], &again, lidar);
}

/// Maps two archives of one recording, in both orders; checks that they are one clip with a pose.
fn check_one_clip(first: &Path, second: &Path, lidar: &Path) {
    let mapped = [[first, second], [second, first]].map(|clips| {
        let out = tempfile::tempdir().unwrap();
        let output = map(&clips, lidar, out.path(), 1);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        files(out.path())
    });
    let told: Value = serde_json::from_slice(&mapped[0]["map.json"]).unwrap();
    assert_eq!(told["clips"].as_array().unwrap().len(), 1);
    for name in FILES {
        assert_eq!(mapped[0][name], mapped[1][name], "{name}");
    }
}

/// Its directory has the sums of the whole archive.
#[test]
fn a_damaged_archive_does_not_stand_for_the_whole_one() {
    let Recorded { clips, lidar, .. } = &*RECORDED;
    let mut bytes = fs::read(&clips[0]).unwrap();
    let name = b"color/0.jpg";
    let at = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len();
    bytes[at + 100..at + 200].iter_mut().for_each(|byte| *byte = !*byte);
    let folder = tempfile::tempdir().unwrap();
    let damaged = folder.path().join("damaged.zip");
    fs::write(&damaged, bytes).unwrap();
    check_one_clip(&clips[0], &damaged, lidar);
}

/// Returns a document of the service with the command's ids of clips.
fn renamed(document: &Value, ids: &BTreeMap<String, String>) -> Value {
    match document {
        Value::String(text) => json!(ids.get(text).unwrap_or(text)),
        Value::Array(items) => items.iter().map(|item| renamed(item, ids)).collect(),
        Value::Object(fields) => {
            Value::Object(fields.iter().map(|(name, value)| (name.clone(), renamed(value, ids))).collect())
        }
        other => other.clone(),
    }
}

#[tokio::test]
async fn it_is_the_map_that_the_service_makes() {
    let Recorded { clips, lidar, .. } = &*RECORDED;
    // First, because it takes longer than the server keeps an idle connection.
    let own = document("map.json");
    let data = tempfile::tempdir().unwrap();
    let server = Process::serve(data.path(), &[]);
    let client = &server.client;
    let home = client.make_home("h").await;
    let own_clips = own["clips"].as_array().unwrap();
    let mut ids = BTreeMap::new();
    for path in clips {
        let clip = client.post(&format!("{home}/clips"), fs::read(path).unwrap()).await.ok(201);
        let same = own_clips.iter().find(|own| own["sha256"] == clip["sha256"]).unwrap();
        let id = |clip: &Value, name: &str| clip[name].as_str().unwrap().to_owned();
        ids.insert(id(&clip, "id"), id(same, "clip"));
    }
    // The clips wait for it, so that they are merged at once: earlier revisions would name the objects.
    client.put(&format!("{home}/lidar-map"), fs::read(lidar).unwrap()).await.ok(201);
    let map = eventually("the map has all clips", || async {
        let answer = client.get(&format!("{home}/map")).await;
        let map = (answer.status == 200).then(|| answer.json())?;
        (map["clips"].as_array().unwrap().len() == clips.len()).then_some(map)
    })
    .await;
    let map = renamed(&map, &ids);
    assert_eq!(map["info"], own["info"]);
    for (place, of_service) in map["clips"].as_array().unwrap().iter().enumerate() {
        for (name, value) in of_service.as_object().unwrap() {
            assert_eq!(&own_clips[place][name], value, "{name} of clip {place}");
        }
    }
    let get = async |name: &str| client.get(&format!("{home}/map/{name}")).await;
    for name in ["rooms", "objects"] {
        let of_service = renamed(&get(name).await.ok(200), &ids);
        let mut own = document(&format!("{name}.json"));
        // The service may have had a revision without clips.
        own["revision"] = of_service["revision"].clone();
        assert_eq!(own, of_service, "{name}");
        assert!(!own[name].as_array().unwrap().is_empty(), "{name}");
    }
    let mut coverage = get("coverage").await.ok(200);
    coverage.as_object_mut().unwrap().remove("revision");
    assert_eq!(own["coverage"], coverage);
    for (name, path) in [
        ("points.ply", "points"),
        ("points.e57", "points?format=e57"),
        ("points.laz", "points?format=laz"),
        ("plan.svg", "plan"),
        ("plan.png", "plan?format=png"),
        ("nav2.zip", "robot?format=nav2"),
        ("calibration.json", "robot?format=calibration"),
        ("valetudo.json", "robot?format=valetudo"),
        ("plan.pdf", "plan?format=pdf"),
        ("plan.geojson", "plan?format=geojson"),
        ("plan.dxf", "plan?format=dxf"),
        ("plan.json", "plan?format=json"),
    ] {
        assert!(get(path).await.bytes == MAPPED.0[name], "{name} is not that of the service");
    }
    // It names clips, whose ids differ and are of one length.
    assert_eq!(get("recording").await.bytes.len(), MAPPED.0["home.mcap"].len());
}

#[test]
fn it_needs_a_lidar_map_but_no_clip_that_can_be_read() {
    let Recorded { folder, broken, lidar, .. } = &*RECORDED;
    let out = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    let output = map(&[broken], &missing, out.path(), 1);
    assert_eq!((output.status.code(), files(out.path()).len()), (Some(1), 0));
    assert!(text(&output.stderr).contains("missing"));
    let output = map(&[], lidar, out.path(), 1);
    assert_eq!(output.status.code(), Some(2));
    // The folder of the clips is no clip, and is not read as a whole.
    let output = map(&[broken, &missing, folder.path()], lidar, out.path(), 1);
    assert_eq!(output.status.code(), Some(3));
    let read =
        |name: &str| -> Value { serde_json::from_slice(&fs::read(out.path().join(name)).unwrap()).unwrap() };
    let map = read("map.json");
    let codes: Vec<&Value> =
        map["clips"].as_array().unwrap().iter().map(|clip| &clip["reasons"][0]["code"]).collect();
    assert_eq!(codes, ["unknown_layout", "unreadable", "unknown_layout"]);
    assert_eq!(map["clips"][0]["file"], folder.path().to_str().unwrap());
    for clip in 0..2 {
        assert_eq!(
            (&map["clips"][clip]["clip"], &map["clips"][clip]["sha256"]),
            (&Value::Null, &Value::Null)
        );
    }
    assert_eq!(map["info"]["points"], json!(0));
    assert_eq!(read("objects.json")["objects"], json!([]));
    assert!(!read("rooms.json")["rooms"].as_array().unwrap().is_empty());
}

/// The robots' files have the map as it was given.
#[cfg(unix)]
#[test]
fn a_valetudo_map_cannot_come_from_a_pipe() {
    let Recorded { broken, lidar, .. } = &*RECORDED;
    let out = tempfile::tempdir().unwrap();
    let (reader, mut writer) = std::io::pipe().unwrap();
    let map = fs::read(lidar).unwrap();
    let sender = std::thread::spawn(move || writer.write_all(&map));
    let mut command = viola();
    command.stdin(reader).arg("map").arg(broken).args(["--lidar", "/dev/stdin", "--out"]).arg(out.path());
    let output = command.output().unwrap();
    sender.join().unwrap().unwrap();
    let told = text(&output.stderr);
    assert!(output.status.code() == Some(1) && told.contains("can be read only once"), "{told}");
}

#[test]
fn clips_in_an_unknown_unit_get_their_scale() {
    let Recorded { clips, lidar, .. } = &*RECORDED;
    let out = tempfile::tempdir().unwrap();
    let mut command = viola();
    command.arg("map").arg(&clips[0]).args(["--scale", "unknown", "--lidar"]).arg(lidar);
    let output = command.arg("--out").arg(out.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let map: Value = serde_json::from_slice(&files(out.path())["map.json"]).unwrap();
    // The clip is in metres.
    let scale = map["clips"][0]["scale"].as_f64().unwrap();
    assert!((scale - 1.0).abs() < 0.05, "{scale}");
    assert_eq!(document("map.json")["clips"][0]["scale"], Value::Null);
}

#[test]
fn no_clip_and_no_lidar_map_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let (out, other) = (folder.path(), folder.path().join("other"));
    for name in FILES {
        let input = out.join(name);
        fs::write(&input, "mine").unwrap();
        for output in [map(&[&input], &other, out, 1), map(&[&other], &input, out, 1)] {
            let told = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{name}: {told}");
            assert!(told.contains(name) && told.contains("choose another --out"), "{name}: {told}");
        }
        assert_eq!(fs::read(&input).unwrap(), b"mine", "{name}");
        fs::remove_file(&input).unwrap();
    }
    // The files of another level are in a folder of its name.
    let upper = out.join("upper");
    fs::create_dir(&upper).unwrap();
    fs::write(upper.join("home.mcap"), "mine").unwrap();
    let level = format!("upper={}", other.display());
    for clip in [upper.join("home.mcap"), upper.clone()] {
        let output = map(&[&clip], Path::new(&level), out, 1);
        let told = text(&output.stderr);
        assert!(output.status.code() == Some(1) && told.contains("choose another --out"), "{told}");
    }
    assert_eq!(fs::read(upper.join("home.mcap")).unwrap(), b"mine");
}

#[test]
fn readers_of_other_programs_find_the_home_in_its_files() {
    let Some(python) = std::env::var_os("VIOLA_FOREIGN_READERS") else {
        let switch =
            "set VIOLA_FOREIGN_READERS to a Python with the packages of tests/foreign/requirements.txt";
        viola_testing::skipped("readers of other programs", switch);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let classes: Vec<Value> =
        Class::ALL.iter().map(|class| json!({ "id": class.id(), "name": class.name() })).collect();
    let known = [("classes.json", json!({ "classes": classes })), ("truth.json", Value::Null)];
    let known = known.map(|(name, document)| (name.to_owned(), document.to_string().into_bytes()));
    for (name, bytes) in MAPPED.0.iter().map(|(name, bytes)| (name.clone(), bytes.clone())).chain(known) {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let check = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/foreign/check.py");
    let mut command = std::process::Command::new(python);
    let files = [
        "points.laz",
        "points.e57",
        "mesh.glb",
        "mesh.obj",
        "mesh.usdz",
        "plan.dxf",
        "plan.pdf",
        "plan.png",
        "plan.geojson",
        "home.mcap",
        "nav2.zip",
        "valetudo.json",
        "calibration.json",
        "matter.json",
    ];
    let output = command.arg("-B").arg(check).arg(folder.path()).args(files).output().unwrap();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    assert_eq!(text(&output.stdout).lines().count(), files.len());
    // Else no name and no box was compared.
    assert!(!document("objects.json")["objects"].as_array().unwrap().is_empty());
}
