//! Lists of clips across homes, and corrections of clips.

use crate::clips::small_clip;
use crate::server::Server;
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use reqwest::Method;
use serde_json::{Value, json};
use viola_testing::client::id_of;
use viola_testing::room;

#[tokio::test]
async fn clips_are_listed_across_homes_by_state_and_reason() {
    let server = Server::without_workers().await;
    let mut clips = Vec::new();
    for home in ["b", "a"] {
        let home = server.make_home(home).await;
        for _ in 0..2 {
            clips.push(server.film(&home, 2).await);
        }
    }
    server.put("/v1/homes/a/lidar-map", room::lidar_csv()).await.ok(201);
    let job = server.job_of(&clips[2]).await;
    server.post(&format!("{job}/cancel"), "").await.ok(200);
    let cases: [(&str, &[usize]); 7] = [
        ("/v1/clips", &[0, 1, 2, 3]),
        ("/v1/clips?state=uploaded", &[0, 1, 2]),
        ("/v1/clips?code=no_lidar_map", &[0, 1]),
        ("/v1/clips?state=uploaded&code=cancelled,no_floor", &[2]),
        ("/v1/clips?code=no_floor", &[]),
        ("/v1/homes/a/clips?code=cancelled", &[2]),
        ("/v1/homes/b/clips?code=cancelled", &[]),
    ];
    for (path, expected) in cases {
        let expected: Vec<&str> = expected.iter().map(|at| id_of(&clips[*at])).collect();
        assert_eq!(server.ids(path).await, expected, "{path}");
    }
    let first = server.get("/v1/clips?state=uploaded&limit=2").await.ok(200);
    assert_eq!(first["items"][0]["home"], "b");
    assert_eq!(first["items"][1]["id"], id_of(&clips[1]));
    let next = first["next"].as_str().unwrap();
    let rest = server.get(&format!("/v1/clips?state=uploaded&limit=2&after={next}")).await.ok(200);
    assert_eq!((&rest["items"][0]["id"], &rest["next"]), (&json!(id_of(&clips[2])), &Value::Null));
    for bad in ["", "no_flor", "no_floor,", "no_floor,no_floor,no_floor,no_floor,no_floor"] {
        let refused = server.get(&format!("/v1/clips?code={bad}")).await.problem(400, "invalid-query");
        assert_eq!(refused["field"], "code", "{bad}");
    }
}

/// The id of another list's item would be a wrong place, and a reader would miss items without a word.
#[tokio::test]
async fn a_cursor_is_taken_by_its_own_list_only() {
    let server = Server::without_workers().await;
    for home in ["a", "b", "1.2"] {
        let home = server.make_room(home).await;
        server.put(&format!("{home}/lidar-map"), format!("{}1,1\n", room::lidar_csv())).await.ok(201);
        for _ in 0..2 {
            server.film(&home, 2).await;
        }
    }
    let lists = [
        "/v1/homes",
        "/v1/clips",
        "/v1/jobs",
        "/v1/changes",
        "/v1/homes/a/clips",
        "/v1/homes/b/clips",
        "/v1/homes/a/lidar-map/revisions",
        "/v1/homes/b/lidar-map/revisions",
        "/v1/homes/a/lidar-maps/main/revisions",
    ];
    for own in lists {
        let next = server.get(&format!("{own}?limit=1")).await.ok(200)["next"].clone();
        let next = next.as_str().unwrap_or_else(|| panic!("{own} has another page"));
        for list in lists {
            let answer = server.get(&format!("{list}?limit=1&after={next}")).await;
            if list == own {
                assert_eq!(answer.ok(200)["items"].as_array().unwrap().len(), 1, "{list}");
            } else {
                let problem = answer.problem(400, "invalid-query");
                assert_eq!(problem["field"], "after", "{list} with the cursor of {own}");
            }
        }
    }
    let object = BASE64_URL_SAFE_NO_PAD.encode("/v1/objects a sofa-1");
    server.get(&format!("/v1/objects?home=a&after={object}")).await.ok(200);
    server.get(&format!("/v1/objects?home=b&after={object}")).await.problem(400, "invalid-query");
    // Cursors of earlier versions had an id only.
    let id = server.get("/v1/clips?limit=1").await.ok(200)["items"][0]["id"].as_str().unwrap().to_owned();
    for (list, id) in [("/v1/clips", id.as_str()), ("/v1/jobs", id.as_str()), ("/v1/homes", "a")] {
        let cursor = BASE64_URL_SAFE_NO_PAD.encode(id);
        let problem = server.get(&format!("{list}?after={cursor}")).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], "after", "{list}");
    }
}

#[tokio::test]
async fn the_time_of_a_recording_is_corrected() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clip = server.post(&format!("{home}/clips?title=Hall"), small_clip()).await;
    let clip = clip.header("location").to_owned();
    let patch = async |body: Value| server.send_json(Method::PATCH, &clip, &body).await;
    let time = "2026-03-14T15:09:26Z";
    let corrected = patch(json!({"recorded_at": "2026-03-14T17:09:26+02:00"})).await.ok(200);
    assert_eq!((&corrected["recorded_at"], &corrected["title"]), (&json!(time), &json!("Hall")));
    assert_eq!(server.get(&clip).await.ok(200), corrected);
    // The same time again changes nothing; a title leaves the time.
    assert_eq!(patch(json!({"recorded_at": time})).await.ok(200), corrected);
    assert_eq!(patch(json!({"title": "Kitchen"})).await.ok(200)["recorded_at"], time);
    for wrong in [
        json!(""),
        json!("yesterday"),
        json!(7),
        json!("1999-12-31T23:59:59Z"),
        json!("2399-01-01T00:00:00Z"),
    ] {
        let problem = patch(json!({"recorded_at": wrong})).await.problem(422, "invalid-body");
        assert_eq!(problem["field"], "recorded_at");
    }
    for wrong in
        [json!(""), json!(" \u{2003}"), json!("a\tb"), json!("a\nb"), json!("t".repeat(201)), json!(7)]
    {
        let problem = patch(json!({"title": wrong})).await.problem(422, "invalid-body");
        assert_eq!(problem["field"], "title");
    }
    // The file has no time of its own.
    let both = patch(json!({"recorded_at": null, "title": null})).await.ok(200);
    assert_eq!((&both["recorded_at"], &both["title"]), (&Value::Null, &Value::Null));
}
