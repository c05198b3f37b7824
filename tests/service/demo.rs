//! `viola demo`, from the outside.

use std::path::Path;
use std::process::Command;
use viola_testing::process::{succeed, viola};

fn demo(folder: &Path) -> Command {
    let mut command = viola();
    command.args(["demo", "--exit", "--listen", "127.0.0.1:0", "--frames", "40", "--data"]).arg(folder);
    command
}

#[test]
fn all_clips_are_found_and_the_pictures_stay() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("demo");
    // The second run starts from scratch.
    for _ in 0..2 {
        let said = succeed(&mut demo(&data));
        assert!(said.contains("3 of 3 clips"), "{said}");
        // The built-in network labels the surface, so the furnished home has objects.
        assert!(said.contains("\nObjects: ") && !said.contains("Objects: none"), "{said}");
        for name in ["clip_0.png", "clip_1.png", "clip_2.png", "clip_0.ply"] {
            let size = std::fs::metadata(data.join("pictures").join(name)).unwrap().len();
            assert!(size > 1000, "{name} has {size} bytes");
        }
    }
}

#[test]
fn an_earlier_demo_stays_if_there_are_no_such_networks() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["made-by-viola-demo", "plan.png"] {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    let missing = folder.path().join("missing");
    let output = demo(folder.path()).arg("--models").arg(missing).output().unwrap();
    let erred = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && erred.contains("the models folder"), "{erred}");
    assert!(folder.path().join("plan.png").exists());
}

#[test]
fn a_folder_with_something_else_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let precious = folder.path().join("precious.txt");
    std::fs::write(&precious, "mine").unwrap();
    let output = demo(folder.path()).output().unwrap();
    assert!(!output.status.success());
    let erred = String::from_utf8_lossy(&output.stderr);
    assert!(erred.contains("--data"), "{erred}");
    assert_eq!(std::fs::read_to_string(&precious).unwrap(), "mine");
}
