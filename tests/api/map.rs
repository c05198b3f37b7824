use crate::clips::TOO_FEW_FRAMES;
use crate::corrections::add;
use crate::server::Server;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use viola_geometry::LevelName;
use viola_storage::{HomeId, map_file};
use viola_testing::client::id_of;
use viola_testing::{eventually, room, until, zips};

/// Returns the home's map once it contains the clips with these paths.
pub async fn merged(server: &Server, home: &str, clips: &[&str]) -> Value {
    let mut wanted: Vec<&str> = clips.iter().map(|clip| id_of(clip)).collect();
    wanted.sort_unstable();
    eventually("the map is merged", || async {
        let answer = server.get(&format!("{home}/map")).await;
        let map = (answer.status == 200).then(|| answer.json())?;
        let mut there: Vec<&str> = list(&map["clips"]).map(|clip| clip["clip"].as_str().unwrap()).collect();
        there.sort_unstable();
        (there == wanted).then_some(map)
    })
    .await
}

/// Returns a server with a home of one clip that is in its map; then the paths of both, and the map.
pub async fn home_of_one_clip() -> (Server, String, String, Value) {
    let server = Server::start().await;
    let home = server.make_room("h").await;
    let clip = server.film(&home, 24).await;
    let map = merged(&server, &home, &[&clip]).await;
    (server, home, clip, map)
}

fn list(value: &Value) -> std::slice::Iter<'_, Value> {
    value.as_array().unwrap().iter()
}

async fn points(server: &Server, home: &str) -> Vec<u8> {
    let answer = server.get(&format!("{home}/map/points")).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "model/ply"));
    answer.bytes
}

#[tokio::test]
async fn clips_become_one_map_that_does_not_depend_on_their_order() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.get(&format!("{home}/map")).await.problem(404, "map-not-found");
    server.get("/v1/homes/nowhere/map").await.problem(404, "home-not-found");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let first = add(&server, &home, 24).await;
    let second = add(&server, &home, 20).await;
    let map = merged(&server, &home, &[&first, &second]).await;
    assert_eq!((&map["lidar_map_revision"], &map["left_out"]), (&json!(1), &json!([])));
    let count = map["info"]["points"].as_u64().unwrap();
    assert!(count > 1000 && map["info"]["classes"].as_array().unwrap().iter().any(|c| c["class"] == "wall"));
    let both = points(&server, &home).await;
    assert!(
        both.starts_with(b"ply\n") && String::from_utf8_lossy(&both[..200]).contains("comment frame map")
    );

    // Removed and added again in the opposite order: the same bytes.
    server.delete(&first).await.ok(204);
    let alone = merged(&server, &home, &[&second]).await;
    assert!(alone["revision"].as_i64() > map["revision"].as_i64());
    assert_ne!(points(&server, &home).await, both);
    let again = add(&server, &home, 24).await;
    merged(&server, &home, &[&second, &again]).await;
    assert_eq!(points(&server, &home).await, both);
}

#[tokio::test]
async fn what_a_reader_has_is_not_sent_again() {
    let (server, home, ..) = home_of_one_clip().await;
    for path in [format!("{home}/map"), format!("{home}/map/points")] {
        let tag = server.get(&path).await.header("etag").to_owned();
        for (known, status) in [(tag.as_str(), 304), ("\"other\"", 200), ("*", 304)] {
            let answer = server.get_with(&path, "if-none-match", known).await;
            assert_eq!((answer.status, answer.header("etag")), (status, tag.as_str()), "{path} {known}");
            assert_eq!(answer.bytes.is_empty(), status == 304);
        }
    }
    // A clip that is left out is listed, which changes the answer but not the points.
    let map_tag = server.get(&format!("{home}/map")).await.header("etag").to_owned();
    let short = server.film(&home, TOO_FEW_FRAMES).await;
    let state = server.settled(&short).await["state"].clone();
    assert_ne!(state, "aligned", "one frame is too little");
    let map = server.get(&format!("{home}/map")).await;
    assert_ne!(map.header("etag"), map_tag);
    let left_out = map.ok(200)["left_out"].clone();
    assert_eq!((&left_out[0]["clip"], &left_out[0]["state"]), (&json!(id_of(&short)), &state));
    assert!(left_out[0]["reasons"][0]["code"].is_string());
    the_state_of_the_map_is_told(&server, &home).await;
}

/// A change that waits for its merge is told, and so are merges that fail, by the map and by its home.
async fn the_state_of_the_map_is_told(server: &Server, home: &str) {
    let state = || async { server.get(&format!("{home}/map")).await.ok(200)["state"].clone() };
    until("the last merge ends", async || state().await == "current").await;
    let due_ms =
        (SystemTime::now() + Duration::from_secs(600)).duration_since(UNIX_EPOCH).unwrap().as_millis();
    for (ahead, faults, expected) in [(0, 0, "current"), (1, 0, "due"), (1, 1, "due"), (1, 2, "failing")] {
        let statement = format!(
            "UPDATE homes SET map_wanted = map_made + {ahead}, map_faults = {faults}, map_due_at = {due_ms}"
        );
        server.execute(&statement).await;
        assert_eq!(state().await, expected, "{ahead} {faults}");
        let told = server.get(home).await.ok(200);
        let needs = told["needs_attention"].as_array().unwrap();
        assert_eq!(
            (&told["map_state"], needs.contains(&json!("map_failing"))),
            (&json!(expected), faults == 2)
        );
        let listed = server.get("/v1/homes?needs_attention=true").await.ok(200);
        assert_eq!(listed["items"].as_array().unwrap().contains(&told), !needs.is_empty());
    }
}

/// Returns the vertices of a binary PLY, of 38 bytes each.
fn vertices(ply: &[u8]) -> Vec<&[u8]> {
    let end = ply.windows(11).position(|part| part == b"end_header\n").unwrap() + 11;
    let head = std::str::from_utf8(&ply[..end]).unwrap();
    let count = head.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap();
    let vertices: Vec<&[u8]> = ply[end..].chunks(38).collect();
    assert_eq!(vertices.len(), count.parse::<usize>().unwrap());
    vertices
}

fn float(vertex: &[u8], at: usize) -> f32 {
    f32::from_le_bytes(vertex[at..at + 4].try_into().unwrap())
}

/// Returns the document and the binary part of a GLB (glTF 2.0, 4.4).
fn glb(bytes: &[u8]) -> (Value, &[u8]) {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    assert_eq!(&bytes[16..20], b"JSON");
    let end = 20 + word(12);
    assert_eq!((end % 4, &bytes[end + 4..end + 8], word(end)), (0, &b"BIN\0"[..], bytes.len() - end - 8));
    (serde_json::from_slice(&bytes[20..end]).unwrap(), &bytes[end + 8..])
}

#[tokio::test]
async fn points_are_filtered_and_come_as_ply_and_as_glb() {
    let (server, home, _, map) = home_of_one_clip().await;
    let ask = async |query: &str| {
        let answer = server.get(&format!("{home}/map/points?{query}")).await;
        assert_eq!(answer.status, 200, "{query}");
        assert_eq!(answer.header("content-length"), answer.bytes.len().to_string());
        answer.bytes
    };
    let all = ask("").await;
    let count = |class: &str| {
        let classes = map["info"]["classes"].as_array().unwrap();
        classes.iter().find(|c| c["class"] == class).map_or(0, |c| c["points"].as_u64().unwrap() as usize)
    };
    assert_eq!(vertices(&all).len(), map["info"]["points"].as_u64().unwrap() as usize);
    assert_eq!(vertices(&ask("classes=wall,floor").await).len(), count("wall") + count("floor"));
    let middle = map["info"]["min_m"][0].as_f64().unwrap() as f32 + 1.0;
    let low: Vec<Vec<u8>> = vertices(&all)
        .into_iter()
        .filter(|v| float(v, 0) <= middle && (0.5..=1.5).contains(&float(v, 8)))
        .map(<[u8]>::to_vec)
        .collect();
    let asked = ask(&format!("box=-100,-100,-100,{middle},100,100&z=0.5,1.5")).await;
    assert!(!low.is_empty() && vertices(&asked) == low);
    let coarse = ask("voxel=0.3").await;
    let cells: BTreeSet<[i64; 3]> = vertices(&all)
        .iter()
        .map(|v| [0, 4, 8].map(|at| (f64::from(float(v, at)) / 0.3).floor() as i64))
        .collect();
    let thinned = vertices(&coarse).len();
    assert!(thinned >= cells.len() && thinned < cells.len() * 2, "{thinned} {}", cells.len());

    // The same points as GLB: every class a node by its name.
    let bytes = ask("format=glb").await;
    let (document, body) = glb(&bytes);
    let names: Vec<&str> = list(&document["nodes"]).map(|node| node["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"wall") && names.contains(&"floor"));
    let mut points = 0;
    let number = |value: &Value| value.as_u64().unwrap() as usize;
    for (mesh, name) in list(&document["meshes"]).zip(&names) {
        let mut of_class = 0;
        for primitive in list(&mesh["primitives"]) {
            assert_eq!(document["materials"][number(&primitive["material"])]["name"], *name);
            let position = &document["accessors"][number(&primitive["attributes"]["POSITION"])];
            let view = &document["bufferViews"][number(&position["bufferView"])];
            let (start, stride) = (number(&view["byteOffset"]), number(&view["byteStride"]));
            for i in 0..number(&position["count"]) {
                for axis in 0..3 {
                    let c = f64::from(float(&body[start + i * stride..], 4 * axis));
                    assert!(c >= position["min"][axis].as_f64().unwrap() - 1e-6);
                    assert!(c <= position["max"][axis].as_f64().unwrap() + 1e-6);
                }
            }
            of_class += number(&position["count"]);
        }
        assert_eq!(of_class, count(name), "{name}");
        points += of_class;
    }
    assert_eq!(points * 40, body.len());
    assert_eq!(points, vertices(&all).len());
    let accepted = server.get_with(&format!("{home}/map/points"), "accept", "model/gltf-binary").await;
    assert_eq!(accepted.bytes, bytes);

    for (query, field) in [
        ("classes=wall,dragon", "classes"),
        ("box=1,2,3", "box"),
        ("box=1,0,0,0,1,1", "box"),
        ("box=0,0,0,1,1,nan", "box"),
        ("z=2,1", "z"),
        ("z=a,b", "z"),
        ("voxel=0.001", "voxel"),
        ("voxel=inf", "voxel"),
        ("format=obj", "format"),
        ("revision=0", "revision"),
    ] {
        let problem = server.get(&format!("{home}/map/points?{query}")).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], field, "{query}");
    }
    server.get(&format!("{home}/map/points?revision=99")).await.problem(404, "map-not-found");
}

#[tokio::test]
async fn a_map_tells_rooms_objects_plan_and_coverage() {
    let server = Server::start().await;
    let home = server.make_room("h").await;
    server.get(&format!("{home}/map/rooms")).await.problem(404, "map-not-found");
    let path = server.film(&home, 24).await;
    merged(&server, &home, &[&path]).await;
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200);
    let area_m2 = rooms["rooms"][0]["area_m2"].as_f64().unwrap();
    assert!((rooms["revision"] == 1) && area_m2 > 5.0, "{rooms:#}");
    let coverage = server.get(&format!("{home}/map/coverage")).await.ok(200);
    assert!(
        coverage["seen"].as_f64().unwrap() > 0.2 && coverage["by_room"][0]["room"] == rooms["rooms"][0]["id"]
    );
    let objects = server.get(&format!("{home}/map/objects")).await.ok(200);
    let count = objects["objects"].as_array().unwrap().len();
    let all = server.get("/v1/objects?limit=200&home=h").await.ok(200);
    assert_eq!(all["items"].as_array().unwrap().len(), count);
    server.get("/v1/objects?home=h&class=sofa").await.ok(200);
    for (format, kind, start) in [
        ("png", "image/png", &b"\x89PNG"[..]),
        ("svg", "image/svg+xml", b"<svg"),
        ("pdf", "application/pdf", b"%PDF-1.4"),
        ("geojson", "application/geo+json", b"{"),
        ("dxf", "image/vnd.dxf", b"999\n"),
        ("json", "application/json", b"{"),
    ] {
        let plan = format!("{home}/map/plan?format={format}");
        let answer = server.get(&plan).await;
        assert_eq!((answer.status, answer.header("content-type")), (200, kind));
        let name = format!("inline; filename=\"h-1-plan.{format}\"");
        assert_eq!(answer.header("content-disposition"), name);
        let begins = String::from_utf8_lossy(&answer.bytes[..60]).into_owned();
        assert!(answer.bytes.starts_with(start) || begins.contains("<?xml"), "{begins}");
        let accepted = server.get_with(&format!("{home}/map/plan"), "accept", kind).await;
        assert_eq!(accepted.bytes, answer.bytes);
        assert_eq!(server.get_with(&plan, "if-none-match", answer.header("etag")).await.status, 304);
    }
    for (format, kind, start) in [
        ("glb", "model/gltf-binary", &b"glTF"[..]),
        ("usdz", "model/vnd.usdz+zip", b"PK"),
        ("obj", "model/obj", b"# viola"),
    ] {
        let mesh = format!("{home}/map/mesh?triangles=1000&format={format}");
        let answer = server.get(&mesh).await;
        assert_eq!((answer.status, answer.header("content-type")), (200, kind));
        assert!(answer.bytes.starts_with(start) && answer.bytes.len() > 10_000, "{format}");
        assert_eq!(server.get_with(&mesh, "if-none-match", answer.header("etag")).await.status, 304);
    }
    mesh_of_the_worker(&server, &home).await;
    for (path, field) in [
        (format!("{home}/map/plan?format=dwg"), "format"),
        (format!("{home}/map/mesh?format=stl"), "format"),
        (format!("{home}/map/mesh?triangles=7"), "triangles"),
        (format!("{home}/map/mesh?level=attic"), "level"),
        (format!("{home}/map/objects?class=dragon"), "class"),
        ("/v1/objects?class=dragon".to_owned(), "class"),
        ("/v1/objects?home=a%2Fb".to_owned(), "home"),
        (format!("{home}/map/rooms?revision=x"), "revision"),
    ] {
        let problem = server.get(&path).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], field, "{path}");
    }
    // The scan of a clip, to draw it anywhere, and the clip's points in the map.
    let scan = server.get(&format!("{path}/scan")).await.ok(200);
    assert!(scan["hits_m"].as_array().unwrap().len() > 50 && scan["cameras"][0]["forward"].is_array());
    assert!(server.get(&format!("{path}/cloud.ply")).await.bytes.starts_with(b"ply\n"));
    let clip = server.get(&path).await.ok(200);
    assert_eq!(
        (&clip["placement"]["by"], &clip["placement"]["map_revision"]),
        (&json!("alignment"), &json!(1))
    );
    // Everything in one zip.
    let answer = server.get(&format!("{home}/export")).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "application/zip"));
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(&answer.bytes)).unwrap();
    let mut read = |name: &str| {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut zip.by_name(name).unwrap(), &mut bytes).unwrap();
        bytes
    };
    let id = clip["id"].as_str().unwrap();
    assert_eq!(read(&format!("clips/{id}/recording")), zips::zip(&room::clip(24)));
    assert_eq!(read("lidar-map/file"), room::lidar_csv().as_bytes());
    assert_eq!(read("map/points.ply"), server.get(&format!("{home}/map/points")).await.bytes);
    assert_eq!(read("map/points.glb"), server.get(&format!("{home}/map/points?format=glb")).await.bytes);
    assert_eq!(read("map/plan.svg"), server.get(&format!("{home}/map/plan")).await.bytes);
    let told: Value = serde_json::from_slice(&read(&format!("clips/{id}/clip.json"))).unwrap();
    assert_eq!(told["sha256"], clip["sha256"]);
    assert!(String::from_utf8(read("README.txt")).unwrap().contains("map_from_clip"));
    server.get("/v1/homes/nowhere/export").await.problem(404, "home-not-found");
    // Without the clip the map is empty, and the previous revision can still be read.
    server.delete(&path).await.ok(204);
    merged(&server, &home, &[]).await;
    assert_eq!(server.get(&format!("{home}/map/objects")).await.ok(200)["objects"], json!([]));
    let before = server.get(&format!("{home}/map?revision=1")).await.ok(200);
    assert_eq!(before["clips"][0]["clip"], clip["id"]);
    assert!(!vertices(&server.get(&format!("{home}/map/points?revision=1")).await.bytes).is_empty());
    assert!(vertices(&server.get(&format!("{home}/map/points")).await.bytes).is_empty());
    let revisions = server.get(&format!("{home}/map/revisions")).await.ok(200);
    let numbers: Vec<&Value> = list(&revisions["items"]).map(|map| &map["revision"]).collect();
    assert_eq!(numbers, [&json!(2), &json!(1)]);
    changes_without_the_manifest(&server, &home).await;
}

/// The manifest is for the next merge. Without it the changes between revisions once were an `internal-error`.
async fn changes_without_the_manifest(server: &Server, home: &str) {
    let path = format!("{home}/map/changes");
    let changes = server.get(&path).await.ok(200);
    assert_eq!((&changes["from"], &changes["to"]), (&json!(1), &json!(2)));
    let id: HomeId = id_of(home).parse().unwrap();
    let storage = server.administer().await;
    let files = storage.home_map_files(&id, 2, LevelName::MAIN, map_file::MANIFEST).await.unwrap();
    storage.close().await;
    let blobs = server.blobs();
    let manifest = blobs.iter().find(|path| path.ends_with(files[0].key())).expect("the revision has one");
    std::fs::remove_file(manifest).unwrap();
    assert_eq!(server.get(&path).await.ok(200), changes);
}

/// The mesh that the worker makes is that of a request, and parts of it are served.
async fn mesh_of_the_worker(server: &Server, home: &str) {
    let revision = server.get(&format!("{home}/map")).await.ok(200)["revision"].as_i64().unwrap();
    let id: HomeId = id_of(home).parse().unwrap();
    let storage = server.administer().await;
    eventually("the worker makes the mesh", || async {
        let files = storage.home_map_files(&id, revision, LevelName::MAIN, map_file::MESH).await.unwrap();
        files.into_iter().next()
    })
    .await;
    storage.close().await;
    let made = server.get(&format!("{home}/map/mesh")).await;
    assert_eq!((made.status, made.header("content-type")), (200, "model/gltf-binary"));
    // One triangle more than the default has no file yet.
    let asked = server.get(&format!("{home}/map/mesh?triangles=200001")).await;
    assert!(made.bytes == asked.bytes, "the room has fewer triangles than either asks for");
    let part = server.get_with(&format!("{home}/map/mesh"), "range", "bytes=0-3").await;
    assert_eq!((part.status, &part.bytes[..], part.header("etag")), (206, &b"glTF"[..], made.header("etag")));
    // A file that lost bytes, or that the store lost, is made again once: the new one takes its place.
    let is_mesh = |path: &PathBuf| std::fs::read(path).is_ok_and(|bytes| bytes == made.bytes);
    let file = || server.blobs().into_iter().find(is_mesh).expect("the mesh is stored");
    std::fs::write(file(), &made.bytes[..9]).unwrap();
    for _ in 0..2 {
        let again = server.get(&format!("{home}/map/mesh")).await;
        assert!(again.status == 200 && again.bytes == made.bytes);
        std::fs::remove_file(file()).unwrap();
    }
}
