//! The networks of a service: the built-in one by default, none on request, and one that cannot be loaded.

use serde_json::Value;
use viola_testing::process::Process;
use viola_testing::{room, zips};

/// Serves with the arguments, and returns the alignment of the furnished room.
async fn alignment(arguments: &[&str]) -> Value {
    let data = tempfile::tempdir().unwrap();
    let server = Process::serve(data.path(), arguments);
    let client = &server.client;
    let home = client.make_room("h").await;
    let clip = client.settled(&client.add_clip(&home, zips::zip(&room::clip(12))).await).await;
    assert_eq!(clip["state"], "aligned", "{clip:#}");
    clip["alignment"].clone()
}

fn has_reason(alignment: &Value, code: &str) -> bool {
    alignment["reasons"].as_array().unwrap().iter().any(|reason| reason["code"] == code)
}

#[tokio::test]
async fn a_fresh_service_labels_by_the_built_in_network() {
    let alignment = alignment(&[]).await;
    let by = alignment["labels"]["by"].as_str().unwrap();
    assert!(by.starts_with("columns, "), "{by}");
    assert!(!has_reason(&alignment, "network_unavailable"));
}

#[tokio::test]
async fn networks_can_be_switched_off() {
    let alignment = alignment(&["--models", "none"]).await;
    assert_eq!(alignment["labels"]["by"], "geometry");
    assert!(!has_reason(&alignment, "network_unavailable"));
}

#[tokio::test]
async fn a_network_that_cannot_be_loaded_leaves_geometry_and_a_reason() {
    let models = tempfile::tempdir().unwrap();
    std::fs::create_dir(models.path().join("columns")).unwrap();
    std::fs::write(models.path().join("columns/columns.onnx"), "<html>not found</html>").unwrap();
    let alignment = alignment(&["--models", models.path().to_str().unwrap()]).await;
    assert_eq!(alignment["labels"]["by"], "geometry");
    assert!(has_reason(&alignment, "network_unavailable"), "{alignment:#}");
}
