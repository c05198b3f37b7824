//! Query parameters that an operation does not have.

use crate::document::{document, operations};
use crate::server::Server;
use reqwest::Method;
use viola_testing::room;

const ID: &str = "01a1f766-7a97-7747-9dbb-391e0eeccb64";

/// Returns a path with a value for each of its variables.
fn filled(path: &str) -> String {
    let value = |name: &str| match name {
        "home" => "h",
        "level" => "main",
        "object" => "sofa-1",
        "room" | "revision" => "1",
        _ => ID,
    };
    let part = |part: &str| {
        part.strip_prefix('{')
            .and_then(|part| part.strip_suffix('}'))
            .map_or(part.to_owned(), |name| value(name).to_owned())
    };
    path.split('/').map(part).collect::<Vec<_>>().join("/")
}

#[tokio::test]
async fn no_operation_takes_a_parameter_that_it_does_not_have() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let mut count = 0;
    for (method, path, _) in operations(&document()) {
        let verb: Method = method.to_uppercase().parse().unwrap();
        let asked = server.request(verb.clone(), &format!("{}?nonsense=1", filled(path)));
        let answer = server.send(asked).await;
        if verb == Method::HEAD {
            assert_eq!(answer.status, 400, "{method} {path}");
        } else {
            assert_eq!(answer.problem(400, "invalid-query")["field"], "nonsense", "{method} {path}");
        }
        count += 1;
    }
    assert!(count > 60, "{count}");
}

#[tokio::test]
async fn a_misspelled_parameter_changes_nothing() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let path = format!("{home}/lidar-map");
    let refused = server.put(&format!("{path}?dryrun=true"), room::lidar_csv()).await;
    let problem = refused.problem(400, "invalid-query");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("`dryrun`") && detail.contains("dry_run, filename"), "{detail}");
    server.get(&path).await.problem(404, "lidar-map-not-found");

    // An encoded name is decoded, and only its beginning is repeated.
    let long = format!("/v1/homes?%6Eame{}=1", "x".repeat(200));
    let field = server.get(&long).await.problem(400, "invalid-query")["field"].clone();
    assert_eq!(field, format!("name{}", "x".repeat(60)));
    server.get("/v1/homes?li%6Dit=1&").await.ok(200);
    // The path of a file of the page has parameters of its own.
    assert_eq!(server.get("/?view=plan").await.status, 200);
}
