//! The manners of the command line: exit codes, pipes, wrong files, completions.

use crate::drawing::{text as json, valetudo};
use crate::writers::{HEIGHT, WIDTH, as_folder, depth_png, scannet, zip_bytes};
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

fn viola(arguments: &[&str], folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viola"));
    // A shell may unset a variable by making it empty.
    command.args(arguments).current_dir(folder).env("ORT_DYLIB_PATH", "");
    command
}

fn run(arguments: &[&str], folder: &Path) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = viola(arguments, folder).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (status.code(), text(stdout), text(stderr))
}

/// Returns a folder with a clip without depth, which gets no pose, a map and a text.
fn without_pose() -> TempDir {
    let mut clip = scannet("s/", &[0, 1, 2]);
    for (_, depth) in clip.iter_mut().filter(|(name, _)| name.contains("depth/")) {
        *depth = depth_png(WIDTH, HEIGHT, |_, _| 0);
    }
    as_folder(&[
        ("clip.zip".to_string(), zip_bytes(&clip)),
        ("map.json".to_string(), json(&valetudo(true, true))),
        ("notes.txt".to_string(), b"Dear diary,".to_vec()),
    ])
}

#[test]
fn an_answer_without_a_pose_has_an_exit_code_of_its_own() {
    let folder = without_pose();
    let align = |clip, flag| {
        run(&["align", "--clip", clip, "--lidar", "map.json", "--out", "answer", flag], folder.path())
    };
    let (code, stdout, stderr) = align("clip.zip", "--json");
    assert_eq!(code, Some(3), "{stderr}");
    let answer: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((&answer["state"], &answer["map_from_clip"]), (&"failed".into(), &serde_json::Value::Null));
    assert_eq!(stderr, "", "no progress goes into a pipe");
    let (code, _, stderr) = align("clip.zip", "--verbose");
    assert!(code == Some(3) && stderr.starts_with("decode\n"), "{stderr}");

    let (code, _, stderr) = align("notes.txt", "--quiet");
    assert_eq!((code, stderr.lines().count()), (Some(1), 3), "{stderr}");
    assert!(stderr.contains("notes.txt is a text file, not a clip"), "{stderr}");
    let (code, _, stderr) = align("map.json", "--quiet");
    assert!(code == Some(1) && stderr.contains("a LiDAR map (give it as --lidar)"), "{stderr}");
    for (map, words) in [
        ("notes.txt", "notes.txt is a text file, not a LiDAR map"),
        ("clip.zip", "clip.zip is a clip (give it as --clip), not a LiDAR map"),
    ] {
        let arguments = ["align", "--clip", "clip.zip", "--lidar", map, "--out", "answer"];
        let (code, _, stderr) = run(&arguments, folder.path());
        assert_eq!((code, stderr.lines().count()), (Some(1), 3), "{stderr}");
        assert!(stderr.contains(words), "{stderr}");
    }
    // The answer of an earlier run does not stay.
    assert!(
        folder.path().join("answer/cloud.ply").exists() && !folder.path().join("answer/result.json").exists()
    );
    std::fs::write(folder.path().join("answer/map.json"), "{}").unwrap();
    let (code, _, _) = run(&["map", "clip.zip", "--lidar", "notes.txt", "--out", "answer"], folder.path());
    assert!(code == Some(1) && !folder.path().join("answer/map.json").exists());
    let (code, _, stderr) = run(&["inspect", "."], folder.path());
    assert_eq!((code, stderr.lines().count()), (Some(1), 3), "{stderr}");
    assert_eq!(align("clip.zip", "--unknown").0, Some(2));
}

#[test]
fn a_wrong_map_or_output_folder_is_told_before_the_work() {
    let folder = without_pose();
    // Nobody can make a file in /proc.
    let proc = if cfg!(target_os = "linux") { "cannot write into the folder /proc" } else { "cannot make" };
    for (clip, lidar, out, words) in [
        ("missing", "notes.txt", "answer", "notes.txt is a text file, not a LiDAR map"),
        ("clip.zip", "map.json", "notes.txt/answer", "cannot make the folder notes.txt/answer"),
        ("clip.zip", "map.json", "/proc", proc),
    ] {
        let arguments = ["align", "--clip", clip, "--lidar", lidar, "--out", out, "--verbose"];
        let (code, _, stderr) = run(&arguments, folder.path());
        assert!(code == Some(1) && stderr.contains(words), "{lidar} {out}: {stderr}");
        assert!(stderr.starts_with("decode\nviola: "), "{lidar} {out}: {stderr}");
    }
}

#[test]
fn align_overwrites_none_of_its_inputs() {
    let yaml = b"image: overlay.png\nresolution: 0.05\n";
    let files = [
        ("result.json", &b"mine"[..]),
        ("inputs.json", b"mine"),
        ("overlay.png", b"mine"),
        ("cloud.ply", b"mine"),
        ("completion/plan_home.png", b"mine"),
        ("map.yaml", yaml),
        ("clip/cloud.ply", b"mine"),
        ("clip/trajectory.txt", b"mine"),
    ]
    .map(|(name, bytes)| (name.to_string(), bytes.to_vec()));
    let folder = as_folder(&files);
    for (clip, lidar, out) in [
        ("missing", "result.json", "."),
        ("missing", "inputs.json", "."),
        ("missing", "overlay.png", "."),
        ("missing", "upper=cloud.ply", "clip/.."),
        ("missing", "completion/plan_home.png", "."),
        ("missing", "map.yaml", "."),
        ("cloud.ply", "missing", "."),
        ("clip", "missing", "clip"),
        ("clip", "missing", "clip/new/answer"),
        ("clip", "clip/cloud.ply", "clip"),
    ] {
        let (code, _, stderr) =
            run(&["align", "--clip", clip, "--lidar", lidar, "--out", out], folder.path());
        assert!(code == Some(1) && stderr.contains("choose another --out"), "{clip} {lidar} {out}: {stderr}");
    }
    for (name, bytes) in files {
        assert_eq!(std::fs::read(folder.path().join(&name)).unwrap(), bytes, "{name}");
    }
    assert!(!folder.path().join("clip/new").exists());
}

#[test]
fn a_simulation_replaces_no_files_of_others() {
    let folder = as_folder(&[("map.yaml".to_string(), b"mine".to_vec())]);
    let (code, _, stderr) = run(&["simulate", "--out", "."], folder.path());
    assert!(code == Some(1) && stderr.contains("map.yaml is not of an earlier simulation"), "{stderr}");
    assert_eq!(std::fs::read(folder.path().join("map.yaml")).unwrap(), b"mine");
}

/// As with `| head -1`.
#[test]
fn a_simulation_is_whole_if_nobody_reads_its_list() {
    let folder = tempfile::tempdir().unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let simulate = ["simulate", "--clips", "0", "--out", "home"];
    let output = viola(&simulate, folder.path()).stdout(writer).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    for name in ["truth.json", "valetudo.json", "map.yaml", "map.pgm", "points.csv", "plan.png"] {
        assert!(folder.path().join("home").join(name).is_file(), "{name}");
    }
}

#[test]
fn the_picture_of_a_network_does_not_replace_its_input() {
    let folder = as_folder(&[("a.png".to_string(), b"mine".to_vec())]);
    let arguments = ["models", "check", "fastdepth", "--picture", "a.png", "--out", "./a.png"];
    let (code, _, stderr) = run(&arguments, folder.path());
    assert!(code == Some(1) && stderr.contains("choose another --out"), "{stderr}");
    let arguments =
        ["models", "check", "fastdepth", "--picture", "a.png", "--out", "b.png", "--models", "empty"];
    let (code, _, stderr) = run(&arguments, folder.path());
    assert!(
        code == Some(1) && stderr.contains("run `viola models fetch fastdepth --models empty`"),
        "{stderr}"
    );
}

#[test]
fn output_that_nobody_reads_ends_quietly() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [&["models", "list"][..], &["man"], &["completions", "zsh"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = viola(arguments, folder.path()).stdout(writer).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && stderr.is_empty(), "{arguments:?}: {stderr}");
    }
}

/// Nobody would know its secret, and it would be valid.
#[test]
fn a_key_that_cannot_be_shown_is_revoked() {
    let folder = tempfile::tempdir().unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let create = ["keys", "create", "--tenant", "acme", "--role", "admin"];
    let output = viola(&create, folder.path()).stdout(writer).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && stderr.contains("cannot be shown"), "{stderr}");
    let (_, keys, _) = run(&["keys", "list", "--json"], folder.path());
    let keys: serde_json::Value = serde_json::from_str(&keys).unwrap();
    assert_eq!((keys.as_array().map(Vec::len), &keys[0]["state"]), (Some(1), &"revoked".into()), "{keys}");
}

#[test]
fn work_does_not_depend_on_readers_of_its_messages() {
    let folder = without_pose();
    let closed = || {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        writer
    };
    for (arguments, code, words) in [
        (
            &["align", "--clip", "clip.zip", "--lidar", "map.json", "--out", "answer", "--verbose", "--json"]
                [..],
            3,
            "\"failed\"",
        ),
        (&["keys", "create", "--tenant", "acme", "--role", "admin"], 0, "viola_"),
        (&["inspect", "missing"], 1, ""),
    ] {
        let output = viola(arguments, folder.path()).stderr(closed()).output().unwrap();
        let stdout = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.code() == Some(code) && stdout.contains(words), "{arguments:?}: {output:?}");
    }
    // Neither the result nor the error about it can be written.
    if cfg!(target_os = "linux") {
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let output =
            viola(&["models", "list"], folder.path()).stdout(full).stderr(closed()).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{output:?}");
    }
}

#[test]
fn shells_and_man_get_their_files() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (code, script, _) = run(&["completions", shell], folder.path());
        assert!(code == Some(0) && script.contains("inspect"), "{shell}");
        assert!(!script.contains("align-job"), "{shell} completes a command of child processes");
    }
    let (code, _, stderr) = run(&["alig"], folder.path());
    assert!(code == Some(2) && stderr.contains("'align'") && !stderr.contains("align-job"), "{stderr}");
    let (code, page, _) = run(&["man"], folder.path());
    assert!(code == Some(0) && page.contains(".TH viola 1"), "{page}");
    assert_eq!(run(&["man", "--out", "pages"], folder.path()).0, Some(0));
    let page = std::fs::read_to_string(folder.path().join("pages/viola-align.1")).unwrap();
    assert!(page.contains("no pose can be given"), "the exit codes are missing: {page}");
    // Commands that only other processes of viola call have no page.
    assert!(!folder.path().join("pages/viola-open-clip.1").exists());
}

#[test]
fn wrong_arguments_have_an_exit_code_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, code, words) in [
        (&["openapi", "--config", "missing.toml"][..], 2, "--config"),
        (&["serve", "--config"], 2, "--config needs"),
        (&["config", "align"], 2, "`align` has no configuration"),
        (
            &[
                "align",
                "--clip",
                "c",
                "--lidar",
                "m",
                "--out",
                "o",
                "--complete",
                "never",
                "--complete-always",
            ],
            2,
            "never",
        ),
        (&["surfaces", "--frames", "0", "--out", "o"], 2, "--frames"),
        (
            &["evaluate", "--set", "normal", "--out", "o", "--threads", "0"],
            2,
            "the number of threads is 1 to",
        ),
        (
            &["align", "--clip", "c", "--lidar", "m", "--out", "o", "--seed", "-1"],
            2,
            "a seed is a whole number",
        ),
        (&["map", "c", "--lidar", "m", "--out", "o", "--seed", "seven"], 2, "a seed is a whole number"),
        (&["simulate", "--out", "o", "--seed", "1.5"], 2, "a seed is a whole number"),
        (&["work", "--workers", "1000000"], 2, "the number of workers is 0 to 256"),
        (&["serve", "--job-seconds", "0"], 2, "'--job-seconds <SECONDS>': it is 1 to 604800 seconds"),
        (&["serve", "--upload-patience-seconds", "0"], 2, "it is 1 to 31536000 seconds"),
        (&["serve", "--max-upload-mb", "0"], 2, "--max-upload-mb"),
        // An empty variable is one that is not set.
        (&["config"], 0, ""),
    ] {
        let output = viola(arguments, folder.path()).env("VIOLA_CONFIG", "").output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(code) && stderr.contains(words), "{arguments:?}: {stderr}");
    }
}

#[test]
fn a_configuration_that_a_command_would_refuse_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("viola.toml", "[work]\nworkers = \"many\"\n"),
        ("name.toml", "wrokers = 2\n"),
        ("type.toml", "workers = [2]\n"),
        ("half.toml", "workers = \n"),
        ("both.toml", "complete = \"never\"\ncomplete-always = true\n"),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    // A file whose form is wrong has the exit code of one with a wrong value.
    for (file, words) in [
        ("name.toml", "`wrokers`"),
        ("type.toml", "`workers`"),
        ("half.toml", "half.toml"),
        ("no.toml", "no.toml"),
    ] {
        for command in [&["config", "work"][..], &["work"]] {
            let output = viola(command, folder.path()).env("VIOLA_CONFIG", file).output().unwrap();
            let stderr = String::from_utf8_lossy(&output.stderr);
            assert!(
                output.status.code() == Some(2) && stderr.contains(words),
                "{command:?} {file}: {stderr}"
            );
        }
    }
    let url = "mysql://user:secret@db/viola";
    for (command, variable, value, words) in [
        ("work", "VIOLA_WORKERS", "many", "--workers"),
        ("work", "VIOLA_WORKERS", "0", "with 0 workers does nothing"),
        ("work", "VIOLA_CONFIG", "viola.toml", "--workers"),
        ("work", "VIOLA_CONFIG", "both.toml", "'--complete-always' cannot be used"),
        ("serve", "VIOLA_CONFIG", "both.toml", "'--complete-always' cannot be used"),
        ("serve", "VIOLA_JOB_MEMORY_MB", "0", "--job-memory-mb"),
        ("serve", "VIOLA_LISTEN", "localhost", "--listen"),
        ("serve", "VIOLA_S3_ENDPOINT", "https://s3.example", "--s3-bucket"),
        ("clean", "VIOLA_S3_ACCESS_KEY_ID", "viola", "--s3-bucket"),
        ("work", "VIOLA_DATABASE_URL", url, "begins with mysql://"),
        ("keys", "VIOLA_DATABASE_URL", url, "begins with mysql://"),
    ] {
        let output = viola(&["config", command], folder.path()).env(variable, value).output().unwrap();
        let stdout = String::from_utf8_lossy(&output.stdout);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && stderr.contains(words), "{command} {value}: {stderr}");
        assert!(stdout.contains("database-url = "), "{stdout}");
        assert!(!stdout.contains("secret@") && !stderr.contains("secret@"), "{stdout}{stderr}");
    }
}

#[cfg(unix)]
#[test]
fn a_data_folder_that_is_a_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "mine").unwrap();
    for data in ["file", "file/data"] {
        let serve = ["serve", "--listen", "127.0.0.1:0", "--no-worker", "--data", data];
        let (code, _, stderr) = run(&serve, folder.path());
        assert!(code != Some(0) && stderr.contains("Name a folder with --data"), "{data}: {stderr}");
    }
}

#[cfg(unix)]
#[test]
fn a_clip_without_room_to_unpack_names_the_folder() {
    let mut files = crate::bags::mcap("", &crate::recording::Recording::small(3));
    files.push(("map.json".to_string(), json(&valetudo(true, true))));
    let folder = as_folder(&files);
    let missing = folder.path().join("missing");
    for (arguments, code) in [
        (&["inspect", "bag_0.mcap"][..], 1),
        (&["convert", "bag_0.mcap", "--to", "tum", "--out", "out"], 1),
        (&["map", "bag_0.mcap", "--lidar", "map.json", "--out", "home"], 3),
    ] {
        let output = viola(arguments, folder.path()).env("TMPDIR", &missing).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        for words in ["no room to unpack the pictures", missing.to_str().unwrap(), "TMPDIR"] {
            assert!(stderr.contains(words), "{arguments:?}: {words}: {stderr}");
        }
    }
}

#[cfg(unix)]
#[test]
fn words_need_not_be_utf_8() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let output = viola(&[], folder.path()).arg(std::ffi::OsStr::from_bytes(b"\xff")).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
}
