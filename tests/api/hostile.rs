//! Hostile files. Each is refused with a stable type, or fails as a clip with a reason; nothing of it stays,
//! and the server lives.

use crate::server::Server;
use reqwest::Method;
use viola_storage::UnpackParams;
use viola_testing::zips::Files;
use viola_testing::{room, until, zips};

/// Room for the archive that would unpack to 10 GB.
const LIMIT_BYTES: u64 = 256 << 20;

async fn check_refused(path: &str, method: Method, body: Vec<u8>, status: u16, code: &str) {
    let server = Server::with(|params| params.max_upload_bytes = LIMIT_BYTES).await;
    server.make_home("h").await;
    let answer = server.send(server.request(method, &format!("/v1/homes/h/{path}")).body(body)).await;
    answer.problem(status, code);
    assert_eq!(server.blobs(), Vec::<std::path::PathBuf>::new());
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 0);
    server.lives().await;
    server.stop().await;
}

async fn check_clip(body: Vec<u8>, status: u16, code: &str) {
    check_refused("clips", Method::POST, body, status, code).await;
}

async fn check_map(body: impl Into<Vec<u8>>, status: u16, code: &str) {
    check_refused("lidar-map", Method::PUT, body.into(), status, code).await;
}

/// Checks a clip that can be opened and whose job then fails with a reason.
async fn check_told(files: &Files, lidar_map: String, code: &str) {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), lidar_map).await.ok(201);
    let path = server.add_clip(&home, zips::zip(files)).await;
    let clip = server.settled(&path).await;
    let codes: Vec<_> =
        clip["reasons"].as_array().unwrap().iter().map(|reason| reason["code"].clone()).collect();
    assert!(codes.contains(&code.into()), "{clip:#}");
    server.lives().await;
    server.stop().await;
}

/// Returns a clip with other bytes in the files whose name begins with `name`.
fn with(name: &str, bytes: &[u8]) -> Files {
    let mut files = room::clip(3);
    for (_, old) in files.iter_mut().filter(|(other, _)| other.starts_with(name)) {
        *old = bytes.to_vec();
    }
    files
}

fn and(name: &str) -> Files {
    let mut files = room::clip(3);
    files.push((name.to_owned(), b"x".to_vec()));
    files
}

fn without(name: &str) -> Files {
    room::clip(3).into_iter().filter(|(other, _)| !other.starts_with(name)).collect()
}

#[tokio::test]
async fn clips_that_are_no_clips() {
    let good = zips::zip(&room::clip(3));
    check_clip(vec![], 422, "body-empty").await;
    check_clip(b"this is not a recording\n".repeat(100), 415, "unknown-layout").await;
    check_clip(good[..good.len() / 2].to_vec(), 422, "zip-truncated").await;
    check_clip(zips::zip(&vec![("readme.txt".to_owned(), b"hello".to_vec())]), 415, "unknown-layout").await;
    check_clip(zips::zip(&and("../../etc/cron.d/x")), 422, "path-escapes").await;
    check_clip(zips::zip(&and("/etc/passwd")), 422, "path-escapes").await;
    check_clip(zips::zip(&without("intrinsic")), 422, "missing-intrinsics").await;
    check_clip(zips::zip(&with("intrinsic", b"0 0 0 0\n")), 422, "bad-intrinsics").await;
    check_clip(zips::zip(&without("depth")), 422, "no-frames").await;
}

#[tokio::test]
async fn a_zip_bomb() {
    let bomb =
        tokio::task::spawn_blocking(|| zips::zip_with_zeros(&without("depth/2"), "depth/2.png", 10 << 30));
    let bomb = bomb.await.unwrap();
    assert!((bomb.len() as u64) < LIMIT_BYTES);
    check_clip(bomb, 422, "zip-bomb").await;
}

#[tokio::test]
async fn archives_that_unpack_to_too_much() {
    let mut archive =
        tar::Builder::new(flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast()));
    let mut files = room::clip(3);
    files.push(("filler.bin".to_owned(), vec![0; 4 << 20]));
    for (name, bytes) in &files {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        archive.append_data(&mut header, name, bytes.as_slice()).unwrap();
    }
    let packed = archive.into_inner().unwrap().finish().unwrap();
    let open = async |path: &str, unpack: UnpackParams| {
        let server = Server::with(|params| params.storage.unpack = unpack).await;
        server.make_home("h").await;
        let answer = server.post(&format!("/v1/homes/h/clips{path}"), packed.clone()).await;
        assert!(answer.status == 200 || server.blobs().is_empty());
        server.stop().await;
        answer
    };
    let (tenant, process) = (UnpackParams { tenant_bytes: 1 << 20, ..UnpackParams::default() }, 1 << 20);
    open("", tenant).await.problem(413, "unpacks-too-large");
    let process = UnpackParams { process_bytes: process, ..UnpackParams::default() };
    open("?dry_run=true", process).await.problem(413, "unpacks-too-large");
    open("?dry_run=true", UnpackParams::default()).await.ok(200);
}

#[tokio::test]
async fn clips_whose_pictures_are_wrong() {
    // The first frame's pictures are read when the clip is opened, the others' when they are used.
    check_clip(zips::zip(&with("color/0", b"no picture")), 422, "bad-picture").await;
    // A picture twice as wide as high cannot show what a depth picture of 4:3 shows.
    let wide = image::RgbImage::from_pixel(200, 100, image::Rgb([90, 90, 90]));
    let mut jpeg = std::io::Cursor::new(Vec::new());
    wide.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    check_clip(zips::zip(&with("color", jpeg.get_ref())), 422, "color-depth-mismatch").await;
    let color = room::clip(1).into_iter().find(|(name, _)| name.starts_with("color")).unwrap().1;
    check_told(&with("color/1", b"no picture"), room::lidar_csv(), "frames_broken").await;
    check_told(&with("depth/1", &color), room::lidar_csv(), "frames_broken").await;
    check_told(&with("depth", &color), room::lidar_csv(), "depth_not_grey16").await;
}

#[tokio::test]
async fn a_map_that_no_clip_fits() {
    check_told(&room::clip(12), "0,0\n0.1,0\n".to_owned(), "no_support").await;
}

#[tokio::test]
async fn maps_that_are_no_maps() {
    let valetudo = |layer: &str| {
        format!(
            r#"{{"__class":"ValetudoMap","metaData":{{"version":2}},"size":{{"x":5000,"y":5000}},"pixelSize":5,
            "layers":[{layer}],"entities":[]}}"#
        )
    };
    let floor = r#"{"type":"floor","compressedPixels":[1,1,50],"metaData":{}}"#;
    let endless = r#"{"type":"wall","compressedPixels":[0,0,1000000000],"metaData":{}}"#;
    check_map("", 422, "body-empty").await;
    check_map("Dear vacuum, please find enclosed nothing.", 415, "unknown-format").await;
    check_map([0u8, 159, 146, 150], 415, "unknown-format").await;
    check_map(valetudo(""), 422, "no-walls").await;
    check_map(valetudo(endless), 422, "bad-field").await;
    let rows = (0..10_000).map(|y| format!("0,{y},100000")).collect::<Vec<_>>().join(",");
    let vast = valetudo(&format!(r#"{{"type":"wall","compressedPixels":[{rows}],"metaData":{{}}}}"#));
    let vast = vast
        .replace(r#""x":5000,"y":5000"#, r#""x":100000,"y":100000"#)
        .replace(r#""pixelSize":5"#, r#""pixelSize":1"#);
    check_map(vast, 422, "too-many-cells").await;
    check_map(&valetudo(floor)[..80], 422, "bad-json").await;
    check_map(r#"{"layers":"#.to_owned() + &"[".repeat(200_000), 422, "bad-json").await;
    check_map("x,y\n1.0,2.0\n1.0,two\n", 422, "bad-points").await;
    check_map("x,y\n1e400,nan\n", 422, "no-walls").await;
    check_map("x,y\n0,0\n99999,99999\n", 422, "map-too-large").await;
}

#[tokio::test]
async fn bodies_that_are_too_large_or_break_off() {
    let server = Server::with(|params| params.max_upload_bytes = 1000).await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    server.post(&clips, vec![0; 1001]).await.problem(413, "body-too-large");
    // Without its length announced.
    let pieces = futures::stream::iter((0..11).map(|_| Ok::<_, std::io::Error>(vec![0u8; 100])));
    server.post(&clips, reqwest::Body::wrap_stream(pieces)).await.problem(413, "body-too-large");
    server.put(&format!("{home}/lidar-map"), vec![b' '; (64 << 20) + 1]).await.problem(413, "body-too-large");
    let form = server.request(Method::POST, &clips).header("content-type", "multipart/form-data; boundary=x");
    server.send(form.body("--x--")).await.problem(415, "unsupported-media-type");

    let broken =
        futures::stream::iter([Ok(vec![0u8; 100]), Err(std::io::Error::other("the phone's battery"))]);
    let request = server.request(Method::POST, &clips).body(reqwest::Body::wrap_stream(broken));
    assert!(request.send().await.is_err());
    until("what the broken body left is gone", async || server.blobs().is_empty()).await;
    server.lives().await;
    server.stop().await;
}
