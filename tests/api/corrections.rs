//! Corrections of people, and the changes between two revisions of a map.

use crate::server::Server;
use image::RgbImage;
use serde_json::{Value, json};
use std::sync::Arc;
use viola::jobs::{JobParams, Method, WorkerParams, align_clip};
use viola_align::{AlignParams, Alignment};
use viola_geometry::taxonomy::{CLASSES, Class};
use viola_reconstruct::label::{ClassMap, LabelParams, SegmentError, Segmenter};
use viola_storage::Role;
use viola_testing::client::{Answer, Client};
use viola_testing::{eventually, room, until};

/// Knows the furniture of the test room by its paint.
struct Painted;

impl Segmenter for Painted {
    fn segment(&self, picture: &RgbImage) -> Result<ClassMap, SegmentError> {
        let class = |red: u8| match red {
            83..=127 => Class::Cabinet,
            128..=172 => Class::Refrigerator,
            _ => Class::Other,
        };
        let mut probabilities = vec![0.0; picture.pixels().len() * CLASSES];
        for (pixel, of_pixel) in picture.pixels().zip(probabilities.chunks_exact_mut(CLASSES)) {
            of_pixel[usize::from(class(pixel[0]).id())] = 1.0;
        }
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        Ok(ClassMap { width, height, align_corners: false, probabilities })
    }

    fn name(&self) -> String {
        "painted".to_owned()
    }
}

/// Starts a server that recognises the furniture of the test room.
pub async fn start() -> Server {
    start_with(align_clip).await
}

async fn start_with(method: Method) -> Server {
    let label = LabelParams { segmenter: Some(Arc::new(Painted)), ..LabelParams::default() };
    let align = JobParams { align: AlignParams { label, ..AlignParams::default() }, ..JobParams::default() };
    let worker = WorkerParams { align: Arc::new(align), method, ..WorkerParams::default() };
    Server::with(|params| params.worker = worker).await
}

pub async fn patch(client: &Client, path: &str, body: &Value) -> Answer {
    let request =
        client.request(reqwest::Method::PATCH, path).header("content-type", "application/merge-patch+json");
    client.send(request.body(body.to_string())).await
}

/// Uploads a clip of the room; returns its path once it is aligned.
pub async fn add(server: &Server, home: &str, frames: u32) -> String {
    let path = server.film(home, frames).await;
    assert_eq!(server.settled(&path).await["state"], "aligned");
    path
}

/// Returns a list of the map, `rooms` or `objects`, once a revision is as expected.
pub async fn list(server: &Server, home: &str, what: &str, is_expected: impl Fn(&Value) -> bool) -> Value {
    eventually(what, || async {
        let answer = server.get(&format!("{home}/map/{what}")).await;
        let list = (answer.status == 200).then(|| answer.json())?;
        is_expected(&list).then_some(list)
    })
    .await
}

/// Returns the list in a revision after this one.
async fn after(server: &Server, home: &str, what: &str, revision: &Value) -> Value {
    let revision = revision.as_i64();
    list(server, home, what, |list| list["revision"].as_i64() > revision).await
}

fn find<'a>(list: &'a Value, what: &str, id: &str) -> Option<&'a Value> {
    list[what].as_array().unwrap().iter().find(|one| one["id"] == id)
}

/// Returns a server with a home of one clip and its map's objects.
async fn furnished() -> (Server, String, Value) {
    let server = start().await;
    let (home, objects) = furnish(&server).await;
    (server, home, objects)
}

async fn furnish(server: &Server) -> (String, Value) {
    let home = server.make_room("h").await;
    add(server, &home, 24).await;
    let objects = list(server, &home, "objects", |list| list["objects"][0].is_object()).await;
    (home, objects)
}

#[tokio::test]
async fn an_object_is_corrected_and_the_correction_withdrawn() {
    let (server, home, objects) = furnished().await;
    let found = objects["objects"][0].clone();
    let id = found["id"].as_str().expect("the room has furniture").to_owned();
    let path = format!("{home}/map/objects/{id}");
    let read = server.get(&path).await;
    let tag = read.header("etag").to_owned();
    assert_eq!(read.ok(200), json!({"object": found, "correction": null}));

    let change = json!({"name": "Grandma's", "class": "bed", "centre_m": [3.0, 1.0, 0.5], "yaw_rad": 4.0});
    let answer = patch(&server, &path, &change).await;
    assert_ne!(answer.header("etag"), tag);
    let state = answer.ok(200);
    assert_eq!((&state["object"], &state["correction"]["class"]), (&found, &json!("bed")));
    let corrected = after(&server, &home, "objects", &objects["revision"]).await;
    let object = find(&corrected, "objects", &id).unwrap();
    assert_eq!((&object["name"], &object["class"]), (&json!("Grandma's"), &json!("bed")));
    assert_eq!((&object["centre_m"], &object["size_m"]), (&json!([3.0, 1.0, 0.5]), &found["size_m"]));
    assert!((object["yaw_rad"].as_f64().unwrap() - (4.0 - std::f64::consts::PI)).abs() < 1e-4);
    assert_eq!(object["corrected"], json!(["class", "name", "centre_m", "yaw_rad"]));
    let changes = server.get(&format!("{home}/map/changes")).await.ok(200);
    assert_eq!(
        (changes["moved"][0]["from"]["id"].as_str(), &changes["to"]),
        (Some(&*id), &corrected["revision"])
    );

    // Of two people who read the same state, the second one is told so.
    let hide = |tag: &str| {
        let request = server.request(reqwest::Method::PATCH, &path).header("if-match", tag);
        server.send(request.json(&json!({"hidden": true})))
    };
    hide(&tag).await.problem(412, "changed-meanwhile");
    hide(server.get(&path).await.header("etag")).await.ok(200);
    let hidden = after(&server, &home, "objects", &corrected["revision"]).await;
    assert_eq!(find(&hidden, "objects", &id), None);
    let all = server.get(&format!("{home}/map/corrections")).await.ok(200);
    assert_eq!((&all["objects"][0]["id"], &all["objects"][0]["hidden"]), (&json!(id), &json!(true)));
    let gone = server.get(&format!("{home}/map/changes")).await.ok(200)["gone"][0].clone();
    assert_eq!((&gone["reason"], &gone["object"]["id"]), (&json!("hidden"), &json!(id)));
    let undo = json!({"name": null, "class": null, "centre_m": null, "yaw_rad": null, "hidden": null});
    assert_eq!(patch(&server, &path, &undo).await.ok(200)["correction"], Value::Null);
    let again = after(&server, &home, "objects", &hidden["revision"]).await;
    assert_eq!(find(&again, "objects", &id), Some(&found));
    let changes = server.get(&format!("{home}/map/changes")).await.ok(200);
    assert_eq!((&changes["found_again"][0]["id"], &changes["discovered"]), (&json!(id), &json!([])));
}

/// Asks for a file of the map that a client may have; returns the status and the tag.
async fn ask(server: &Server, home: &str, file: &str, known: &str) -> (u16, String) {
    let answer = server.get_with(&format!("{home}/map/{file}"), "if-none-match", known).await;
    (answer.status, answer.header("etag").to_owned())
}

/// A page that has the points and the mesh does not load them again because of a name.
#[tokio::test]
async fn a_new_name_leaves_the_points_and_the_mesh_as_they_are() {
    let (server, home, objects) = furnished().await;
    let id = objects["objects"][0]["id"].as_str().expect("the room has furniture");
    let path = format!("{home}/map/objects/{id}");
    let files = ["points", "points?format=laz&classes=wall", "mesh?triangles=1000", "points?z=0,1"];
    let mut tags = Vec::new();
    for file in files {
        let (status, tag) = ask(&server, &home, file, "\"none\"").await;
        assert!(status == 200 && !tags.contains(&tag), "{file}");
        tags.push(tag);
    }
    patch(&server, &path, &json!({"name": "Grandma's"})).await.ok(200);
    let named = after(&server, &home, "objects", &objects["revision"]).await;
    assert_eq!(find(&named, "objects", id).unwrap()["name"], "Grandma's");
    for (file, tag) in files.iter().zip(&tags) {
        assert_eq!(ask(&server, &home, file, tag).await, (304, tag.clone()), "{file}");
    }
    let earlier = format!("points?revision={}", objects["revision"]);
    assert_eq!(ask(&server, &home, &earlier, &tags[0]).await.0, 304);
    // A hidden object is no part of the mesh, and its points stay.
    patch(&server, &path, &json!({"hidden": true})).await.ok(200);
    after(&server, &home, "objects", &named["revision"]).await;
    assert_eq!(ask(&server, &home, files[0], &tags[0]).await.0, 304);
    assert_eq!(ask(&server, &home, files[2], &tags[2]).await.0, 200);
    add(&server, &home, 20).await;
    let known = &tags[0];
    until("the points change", async || ask(&server, &home, files[0], known).await.0 == 200).await;
}

#[tokio::test]
async fn corrections_survive_ten_revisions_and_a_new_lidar_map() {
    let (server, home, objects) = furnished().await;
    let found = objects["objects"][0].clone();
    let id = found["id"].as_str().expect("the room has furniture").to_owned();
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200);
    let room_id = rooms["rooms"][0]["id"].as_str().unwrap().to_owned();
    let place = [3.5, 0.5, 0.4];
    let change = json!({"class": "sofa", "centre_m": place});
    patch(&server, &format!("{home}/map/objects/{id}"), &change).await.ok(200);
    patch(&server, &format!("{home}/map/rooms/{room_id}"), &json!({"name": "Lounge"})).await.ok(200);
    let is_corrected = |list: &Value, place: [f64; 3]| {
        let object = find(list, "objects", &id)?;
        let at = object["centre_m"].as_array()?;
        let near = (0..3).all(|axis| (at[axis].as_f64().unwrap() - place[axis]).abs() < 0.1);
        (object["class"] == "sofa" && near && object["corrected"] == json!(["class", "centre_m"]))
            .then_some(())
    };
    // Both corrections are in the map before a clip comes, so that each later revision is of a clip.
    list(&server, &home, "objects", |list| is_corrected(list, place).is_some()).await;
    let is_named = |list: &Value| list["rooms"][0]["name"] == "Lounge";
    let mut last = list(&server, &home, "rooms", is_named).await["revision"].clone();
    for n in 0..6 {
        let clip = add(&server, &home, 25 + n).await;
        let with = after(&server, &home, "objects", &last).await;
        server.delete(&clip).await.ok(204);
        let without = after(&server, &home, "objects", &with["revision"]).await;
        for list in [&with, &without] {
            assert!(is_corrected(list, place).is_some(), "{n}: {list:#}");
        }
        last = without["revision"].clone();
    }
    assert!(last.as_i64() >= Some(11), "{last}");
    for path in ["map/changes?from=1&to=2", "map?revision=1", "map/plan?revision=1"] {
        server.get(&format!("{home}/{path}")).await.problem(410, "map-revision-removed");
    }
    // The same room in another frame: turned by a quarter, and moved.
    let turned = |x: f64, y: f64| [3.0 - y, x + 1.0];
    server.put(&format!("{home}/lidar-map"), room::lidar_csv_moved(turned)).await.ok(201);
    let moved = after(&server, &home, "objects", &last).await;
    let [x, y] = turned(place[0], place[1]);
    assert!(is_corrected(&moved, [x, y, place[2]]).is_some(), "{moved:#}");
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200);
    let named = |room: &&Value| room["name"] == "Lounge" && room["corrected"] == json!(["name"]);
    assert_eq!(rooms["rooms"].as_array().unwrap().iter().filter(named).count(), 1, "{rooms:#}");
}

#[tokio::test]
async fn names_displace_no_revision_of_other_clips() {
    let (server, home, objects) = furnished().await;
    let first = objects["revision"].clone();
    add(&server, &home, 25).await;
    after(&server, &home, "objects", &first).await;
    for n in 0..6 {
        let name = format!("Room {n}");
        patch(&server, &format!("{home}/map/rooms/1"), &json!({"name": name})).await.ok(200);
        list(&server, &home, "rooms", |list| list["rooms"][0]["name"] == name.as_str()).await;
    }
    let kept = server.get(&format!("{home}/map/revisions")).await.ok(200);
    let kept: Vec<&Value> = kept["items"].as_array().unwrap().iter().map(|map| &map["revision"]).collect();
    assert_eq!((kept.len(), kept[4]), (5, &first), "{kept:?}");
    // The revision before this one is removed, so the changes are those since the first.
    let changes = server.get(&format!("{home}/map/changes?to={}", kept[3])).await.ok(200);
    assert_eq!((&changes["from"], &changes["to"]), (&first, kept[3]));
    let removed = kept[3].as_i64().unwrap() - 1;
    server.get(&format!("{home}/map?revision={removed}")).await.problem(410, "map-revision-removed");
}

/// Runs the real method; in another map than the first the clip has no pose.
const ONLY_IN_THE_FIRST_MAP: Method = |clip, map, params, progress| {
    let mut finished = align_clip(clip, map, params, progress)?;
    if map[0].bytes != room::lidar_csv().as_bytes() {
        finished.alignment = Alignment::failed();
    }
    Ok(finished)
};

#[tokio::test]
async fn corrections_move_with_a_new_lidar_map_that_no_clip_is_in() {
    let server = start_with(ONLY_IN_THE_FIRST_MAP).await;
    let (home, objects) = furnish(&server).await;
    let id = objects["objects"][0]["id"].as_str().expect("the room has furniture").to_owned();
    let place = [3.5, 0.5, 0.4];
    let hold = json!({"centre_m": place, "pinned": true});
    patch(&server, &format!("{home}/map/objects/{id}"), &hold).await.ok(200);
    let corrected = json!(["centre_m", "pinned"]);
    let is_pinned =
        |list: &Value| find(list, "objects", &id).is_some_and(|object| object["corrected"] == corrected);
    let last = list(&server, &home, "objects", is_pinned).await["revision"].clone();
    let turned = |x: f64, y: f64| [3.0 - y, x + 1.0];
    server.put(&format!("{home}/lidar-map"), room::lidar_csv_moved(turned)).await.ok(201);
    let moved = after(&server, &home, "objects", &last).await;
    assert_eq!(server.get(&format!("{home}/map")).await.ok(200)["clips"], json!([]));
    let object = find(&moved, "objects", &id).expect("it is pinned");
    let [x, y] = turned(place[0], place[1]);
    for (axis, wanted) in [(0, x), (1, y)] {
        let miss_m = object["centre_m"][axis].as_f64().unwrap() - wanted;
        assert!(miss_m.abs() < 0.1, "{object:#}");
    }
}

#[tokio::test]
async fn a_room_is_named_and_divided() {
    let (server, home, _) = furnished().await;
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200);
    let found = rooms["rooms"][0].clone();
    let id = found["id"].as_str().unwrap().to_owned();
    let path = format!("{home}/map/rooms/{id}");
    assert_eq!(server.get(&path).await.ok(200), json!({"room": found, "correction": null}));
    let label = [0, 1].map(|axis| found["label_at_m"][axis].as_f64().unwrap());
    let line = json!({"from_m": [label[0] + 0.3, label[1]], "to_m": [label[0] + 0.3, label[1] + 1.0]});
    patch(&server, &path, &json!({"name": "Lounge", "split_by": line})).await.ok(200);
    let divided = list(&server, &home, "rooms", |list| list["rooms"][0]["name"] == "Lounge").await;
    let parts = divided["rooms"].as_array().unwrap();
    let area_m2 = |room: &Value| room["area_m2"].as_f64().unwrap();
    assert_eq!((parts.len(), &parts[1]["id"]), (2, &json!(format!("{id}-b"))));
    assert!((area_m2(&parts[0]) + area_m2(&parts[1]) - area_m2(&found)).abs() < 0.5, "{divided:#}");
    assert_eq!(parts[0]["corrected"], json!(["split_by", "name"]));
    let undo = patch(&server, &path, &json!({"split_by": null})).await.ok(200);
    assert_eq!(
        (&undo["correction"]["split_by"], &undo["correction"]["name"]),
        (&Value::Null, &json!("Lounge"))
    );
    let whole = list(&server, &home, "rooms", |list| list["rooms"].as_array().unwrap().len() == 1).await;
    assert_eq!(
        (&whole["rooms"][0]["name"], &whole["rooms"][0]["polygon_m"]),
        (&json!("Lounge"), &found["polygon_m"])
    );
}

#[tokio::test]
async fn corrections_that_are_refused() {
    let (server, home, objects) = furnished().await;
    let id = objects["objects"][0]["id"].as_str().expect("the room has furniture").to_owned();
    let object = format!("{home}/map/objects/{id}");
    let room = format!("{home}/map/rooms/1");
    for (path, body, field) in [
        (&object, json!({"class": "dragon"}), json!("class")),
        (&object, json!({"class": 7}), json!("class")),
        (&object, json!({"name": ""}), json!("name")),
        (&object, json!({"name": " \u{a0}"}), json!("name")),
        (&object, json!({"name": "a\nb"}), json!("name")),
        (&object, json!({"name": "a".repeat(101)}), json!("name")),
        (&object, json!({"centre_m": [1.0, 2.0]}), json!("centre_m")),
        (&object, json!({"centre_m": [1.0, 2.0, 99.0]}), json!("centre_m")),
        (&object, json!({"centre_m": [1e300, 2.0, 0.0]}), json!("centre_m")),
        (&object, json!({"size_m": [1.0, 2.0, 1.0]}), json!("size_m")),
        (&object, json!({"size_m": [1.0, 0.0, 1.0]}), json!("size_m")),
        (&object, json!({"yaw_rad": 90}), json!("yaw_rad")),
        (&object, json!({"pinned": "yes"}), json!("pinned")),
        (&object, json!({"hidden": 1}), json!("hidden")),
        (&object, json!({"colour": "red"}), json!("colour")),
        (&room, json!({"name": "  "}), json!("name")),
        (&room, json!({"merge_with": []}), json!("merge_with")),
        (&room, json!({"merge_with": ["1"]}), json!("merge_with")),
        (&room, json!({"merge_with": ["nowhere"]}), json!("merge_with")),
        (&room, json!({"split_by": {"from_m": [0.0, 0.0]}}), json!("split_by")),
        (&room, json!({"split_by": {"from_m": [0.0, 0.0], "to_m": [0.0, 0.0]}}), json!("split_by")),
        (&room, json!({"split_by": {"from_m": [99.0, 0.0], "to_m": [99.0, 1.0]}}), json!("split_by")),
        (&room, json!({"area_m2": 7}), json!("area_m2")),
    ] {
        let problem = patch(&server, path, &body).await.problem(422, "invalid-body");
        assert_eq!(problem["field"], field, "{body}");
    }
    let body = json!({"name": "x"});
    for (path, code) in [
        (format!("{home}/map/objects/chair-99"), "object-not-found"),
        (format!("{home}/map/rooms/99"), "room-not-found"),
        ("/v1/homes/nowhere/map/objects/chair-1".to_owned(), "home-not-found"),
    ] {
        patch(&server, &path, &body).await.problem(404, code);
        server.get(&path).await.problem(404, code);
    }
    assert_eq!(
        server.get(&format!("{home}/map/corrections")).await.ok(200),
        json!({"objects": [], "rooms": []})
    );
    for (query, status, code) in [
        ("from=0", 200, ""),
        ("from=0&to=1", 200, ""),
        ("from=1&to=1", 400, "invalid-query"),
        ("from=-1", 400, "invalid-query"),
        ("to=x", 400, "invalid-query"),
        ("to=99", 404, "map-not-found"),
    ] {
        let answer = server.get(&format!("{home}/map/changes?{query}")).await;
        match status {
            200 => assert_eq!(
                // The first clip of a place discovers what is there; nothing was added.
                answer.ok(200)["discovered"].as_array().map(Vec::len),
                objects["objects"].as_array().map(Vec::len)
            ),
            _ => drop(answer.problem(status, code)),
        }
    }
    // Only an admin corrects, and only homes of the tenant.
    let reader = server.client("default", Role::Reader, None).await;
    patch(&reader, &object, &body).await.problem(403, "forbidden");
    assert_eq!(reader.get(&object).await.status, 200);
    let other = server.client("acme", Role::Admin, None).await;
    patch(&other, &object, &body).await.problem(404, "home-not-found");
}
