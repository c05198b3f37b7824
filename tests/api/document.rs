//! The OpenAPI document, its page, and the operator's page.

use crate::server::Server;

#[tokio::test]
async fn the_document_that_is_checked_in_is_the_one_that_is_served() {
    let served = Server::start().await.get("/openapi.json").await.ok(200);
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/viola.json");
    let checked_in = std::fs::read_to_string(file).unwrap();
    assert!(
        checked_in == viola::api::document_json(),
        "openapi/viola.json is stale: cargo run -- openapi > openapi/viola.json"
    );
    assert_eq!(serde_json::from_str::<serde_json::Value>(&checked_in).unwrap(), served);
}

#[tokio::test]
async fn every_operation_has_what_a_client_generator_needs() {
    let document: serde_json::Value = serde_json::from_str(&viola::api::document_json()).unwrap();
    let mut ids = std::collections::HashSet::new();
    for (path, operations) in document["paths"].as_object().unwrap() {
        for (method, operation) in operations.as_object().unwrap() {
            let name = format!("{method} {path}");
            assert!(ids.insert(operation["operationId"].as_str().unwrap()), "{name}");
            assert_eq!(operation["tags"].as_array().unwrap().len(), 1, "{name}");
            assert!(operation["summary"].is_string(), "{name}");
            for (status, response) in operation["responses"].as_object().unwrap() {
                let is_problem = response["content"]["application/problem+json"].is_object();
                assert_eq!(is_problem, status.as_str() >= "400", "{name} {status}");
            }
        }
    }
}

#[tokio::test]
async fn pages_load_nothing_from_elsewhere() {
    let server = Server::start().await;
    let pages = [
        ("/", "text/html"),
        ("/page.css", "text/css"),
        ("/page.js", "text/javascript"),
        ("/docs/", "text/html"),
        ("/docs/swagger-initializer.js", "text/javascript"),
    ];
    for (path, media_type) in pages {
        let page = server.get(path).await;
        assert_eq!(page.status, 200, "{path}");
        assert!(page.header("content-type").starts_with(media_type), "{path}");
        let text = String::from_utf8(page.bytes).unwrap();
        assert!(!text.contains("http://") && !text.contains("https://"), "{path} names another host");
    }
    assert!(server.get("/").await.header("content-security-policy").contains("default-src 'none'"));
}
