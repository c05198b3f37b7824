use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};

#[tokio::test]
async fn a_home_is_made_renamed_read_and_removed() {
    let server = Server::start().await;
    let put = async |body: Value| server.send_json(Method::PUT, "/v1/homes/h-1", &body).await;
    let made = put(json!({"name": "Elm Street"})).await.ok(201);
    assert_eq!((&made["id"], &made["name"]), (&json!("h-1"), &json!("Elm Street")));
    assert_eq!((&made["lidar_map_revision"], &made["clips"]), (&Value::Null, &json!(0)));
    assert_eq!(server.get("/v1/homes/h-1").await.ok(200), made);
    assert_eq!(put(json!({"name": null})).await.ok(200)["name"], Value::Null);
    assert_eq!(server.put("/v1/homes/h-1", "").await.ok(200)["id"], "h-1");
    assert_eq!(put(Value::Null).await.ok(200)["id"], "h-1");
    server.delete("/v1/homes/h-1").await.ok(204);
    server.get("/v1/homes/h-1").await.problem(404, "home-not-found");
    server.delete("/v1/homes/h-1").await.problem(404, "home-not-found");
}

#[tokio::test]
async fn homes_are_listed_by_pages() {
    let server = Server::start().await;
    let ids: Vec<String> = (0..7).map(|n| format!("home-{n}")).collect();
    for id in &ids {
        server.make_home(id).await;
    }
    let (mut seen, mut after) = (Vec::new(), String::new());
    for pages in 1.. {
        let page = server.get(&format!("/v1/homes?limit=3{after}")).await.ok(200);
        let items = page["items"].as_array().unwrap();
        seen.extend(items.iter().map(|home| home["id"].as_str().unwrap().to_owned()));
        match page["next"].as_str() {
            Some(next) => after = format!("&after={next}"),
            None => {
                assert_eq!(pages, 3);
                break;
            }
        }
    }
    assert_eq!(seen, ids);
    // A page that ends exactly with the list says so.
    assert_eq!(server.get("/v1/homes?limit=7").await.ok(200)["next"], Value::Null);
    assert_eq!(server.get("/v1/homes").await.ok(200)["items"].as_array().unwrap().len(), 7);
}
