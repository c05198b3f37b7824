//! The OpenAPI document, its page, and the operator's page.

use crate::server::Server;
use serde_json::{Value, json};
use std::collections::HashSet;
use std::fs;
use std::path::Path;

/// Returns the OpenAPI document.
pub fn document() -> Value {
    serde_json::from_str(&viola::api::document_json()).unwrap()
}

/// Returns method, path and description of every operation.
pub fn operations(document: &Value) -> impl Iterator<Item = (&str, &str, &Value)> {
    let paths = document["paths"].as_object().unwrap().iter();
    paths.flat_map(|(path, methods)| {
        let methods = methods.as_object().unwrap().iter();
        methods.map(move |(method, operation)| (method.as_str(), path.as_str(), operation))
    })
}

/// Returns status and description of every answer of an operation.
fn answers<'a>(document: &'a Value, operation: &'a Value) -> impl Iterator<Item = (&'a str, &'a Value)> {
    let answers = operation["responses"].as_object().unwrap().iter();
    answers.map(|(status, answer)| (status.as_str(), resolved(document, answer)))
}

#[tokio::test]
async fn the_document_that_is_checked_in_is_the_one_that_is_served() {
    let served = Server::start().await.get("/openapi.json").await.ok(200);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/viola.json");
    let checked_in = fs::read_to_string(file).unwrap();
    assert!(
        checked_in == viola::api::document_json(),
        "openapi/viola.json is stale: cargo run -- openapi > openapi/viola.json"
    );
    assert_eq!(serde_json::from_str::<Value>(&checked_in).unwrap(), served);
}

#[tokio::test]
async fn every_operation_has_what_a_client_generator_needs() {
    let document = document();
    let mut ids = HashSet::new();
    for (method, path, operation) in operations(&document) {
        let name = format!("{method} {path}");
        assert!(ids.insert(operation["operationId"].as_str().unwrap()), "{name}");
        assert_eq!(operation["tags"].as_array().unwrap().len(), 1, "{name}");
        assert!(operation["summary"].is_string(), "{name}");
        for (status, answer) in answers(&document, operation) {
            let is_problem = answer["content"]["application/problem+json"].is_object();
            assert_eq!(is_problem, status >= "400", "{name} {status}");
        }
    }
}

/// Returns what a part of the document refers to, or the part itself.
fn resolved<'a>(document: &'a Value, part: &'a Value) -> &'a Value {
    let Some(name) = part["$ref"].as_str() else { return part };
    document.pointer(name.strip_prefix('#').unwrap()).unwrap()
}

/// An answer of an operation was once replaced by the common one of the same status.
#[test]
fn no_description_of_an_answer_is_lost() {
    let document = document();
    let mut told = HashSet::new();
    for (_, _, operation) in operations(&document) {
        let answers = answers(&document, operation);
        told.extend(answers.map(|(status, answer)| (status, answer["description"].as_str().unwrap())));
    }
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src/api")];
    let mut count = 0;
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            // A line that ends with a backslash goes on in the next one.
            let source = fs::read_to_string(&path).unwrap();
            let source: String = source.split("\\\n").map(str::trim_start).collect();
            for answer in source.split("(status = ").skip(1) {
                let Some((status, rest)) = answer.split_once(", description = \"") else { continue };
                let (description, _) = rest.split_once('"').unwrap();
                assert!(told.contains(&(status, description)), "{status} {description}");
                count += 1;
            }
        }
    }
    assert!(count > 100, "{count}");
}

/// Programs know the codes of reasons, and show the advice of docs/api.md.
#[test]
fn the_codes_of_reasons_are_those_of_the_page_with_its_advice() {
    let document = document();
    let code = &document["components"]["schemas"]["Reason"]["properties"]["code"];
    assert_eq!(code["$ref"], "#/components/schemas/ReasonCode");
    let schema = &document["components"]["schemas"]["ReasonCode"];
    let page = include_str!("../../docs/api.md").split("\n## Reasons\n").nth(1).unwrap();
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.strip_suffix(" |"));
    let mut advice = serde_json::Map::new();
    for row in rows {
        let cells: Vec<&str> = row.split(" | ").collect();
        let [codes, _, told] = cells[..] else { panic!("{row}") };
        for code in codes.trim_end_matches('`').split("`, `") {
            advice.insert(code.to_owned(), told.into());
        }
    }
    assert!(advice.len() > 40, "{advice:?}");
    assert_eq!(schema["x-advice"], Value::Object(advice.clone()));
    let codes = schema["enum"].as_array().unwrap();
    for (code, told) in &advice {
        assert!(codes.contains(&code.as_str().into()), "{code}");
        let line = format!("- `{code}`: {}", told.as_str().unwrap());
        assert!(schema["description"].as_str().unwrap().contains(&line), "{line}");
    }
    // Those of the readers of files.
    assert!(codes.contains(&"bad_picture".into()) && codes.len() > advice.len() + 50);
}

/// A receiver of messages and a reader of streams generate their types from the document, too.
#[test]
fn messages_and_events_are_described() {
    let document = document();
    let schemas = &document["components"]["schemas"];
    for (name, body) in [("change", "WebhookMessage"), ("test", "WebhookTest")] {
        let content = &document["webhooks"][name]["post"]["requestBody"]["content"]["application/json"];
        assert_eq!(content["schema"]["$ref"], format!("#/components/schemas/{body}"));
    }
    let kinds = schemas["ChangeKind"]["enum"].as_array().unwrap();
    let types = schemas["WebhookMessageType"]["enum"].as_array().unwrap();
    assert_eq!(types.len(), 2 * kinds.len());
    for kind in kinds.iter().map(|kind| kind.as_str().unwrap()) {
        for end in ["changed", "deleted"] {
            assert!(types.contains(&format!("{kind}.{end}").into()), "{kind}.{end}");
        }
    }
    for (path, event) in [("/v1/jobs/{job}/events", "JobEvent"), ("/v1/homes/{home}/events", "HomeEvent")] {
        let content = &document["paths"][path]["get"]["responses"]["200"]["content"]["text/event-stream"];
        assert_eq!(content["x-item-schema"]["$ref"], format!("#/components/schemas/{event}"));
        for member in ["event", "id", "data"] {
            assert!(schemas[event]["properties"][member].is_object(), "{event}.{member}");
        }
    }
    assert_eq!(schemas["JobEventName"]["enum"], json!(["job", "end"]));
    assert_eq!(schemas["HomeEventName"]["enum"], json!(["change"]));
    // A reader that takes it for a number loses its place.
    let id = schemas["HomeEvent"]["examples"][0]["id"].as_str().unwrap();
    assert!(id.contains('.') && id.parse::<i64>().is_err(), "{id}");
}

/// A reader of the document learns the meaning of each state, and what to do.
#[test]
fn the_values_of_states_are_explained() {
    let document = document();
    let states = [
        "ClipState",
        "AlignmentState",
        "JobState",
        "UploadState",
        "MapState",
        "DeliveryState",
        "Attention",
        "JobEventName",
        "HomeEventName",
        "ChangeKind",
        "PlacedBy",
        "GoneReason",
        "LostReason",
    ];
    for name in states {
        let schema = &document["components"]["schemas"][name];
        let description = schema["description"].as_str().unwrap();
        for value in schema["enum"].as_array().unwrap() {
            let item = format!("- `{}`: ", value.as_str().unwrap());
            assert!(description.contains(&item), "{name} {value}: {description}");
        }
    }
}

/// A mock of the service answers with the examples.
#[test]
fn examples_of_places_have_as_many_numbers_as_answers() {
    let document = document();
    for (name, members) in [
        ("MapObject", ["centre_m", "size_m"]),
        ("ObjectCorrection", ["centre_m", "size_m"]),
        ("HomeMapInfo", ["min_m", "max_m"]),
    ] {
        let schema = &document["components"]["schemas"][name];
        for member in members {
            let place = &schema["properties"][member];
            assert!(place["minItems"] == 3 && place["maxItems"] == 3, "{name}.{member}: {place}");
            let example = schema["examples"][0][member].as_array().unwrap();
            assert_eq!(example.len(), 3, "{name}.{member}");
        }
    }
}

/// Files are served in parts, and everything but streams and archives made on the way has an entity tag.
#[test]
fn entity_tags_and_ranges_are_told_where_they_are_served() {
    let document = document();
    for (path, has_tag, has_parts) in [
        ("/v1/homes/{home}", true, false),
        ("/v1/homes/{home}/map/objects", true, false),
        ("/v1/homes/{home}/map/points", true, true),
        ("/v1/homes/{home}/map/plan", true, true),
        ("/v1/homes/{home}/clips/{clip}/recording", true, true),
        ("/v1/homes/{home}/lidar-map/image.png", true, true),
        ("/v1/homes/{home}/export", false, false),
        ("/v1/homes/{home}/events", false, false),
    ] {
        let operation = &document["paths"][path]["get"];
        let parameters = operation["parameters"].as_array().unwrap();
        let has_header = |name: &str| parameters.iter().any(|parameter| parameter["name"] == name);
        let answers = &operation["responses"];
        assert_eq!(answers["200"]["headers"]["ETag"].is_object(), has_tag, "{path}");
        for (name, status) in [("If-None-Match", "304"), ("If-Match", "412")] {
            assert_eq!(has_header(name), has_tag, "{path} {name}");
            assert_eq!(answers[status].is_object(), has_tag, "{path} {status}");
        }
        for name in ["Range", "If-Range"] {
            assert_eq!(has_header(name), has_parts, "{path} {name}");
        }
        for status in ["206", "416"] {
            assert_eq!(answers[status].is_object(), has_parts, "{path} {status}");
        }
    }
    for (_, _, operation) in operations(&document) {
        let refusal = resolved(&document, &operation["responses"]["429"]);
        assert!(refusal.is_null() || refusal["headers"]["Retry-After"].is_object(), "{refusal}");
    }
    let png = &document["paths"]["/v1/homes/{home}/map/plan"]["get"]["responses"]["206"]["content"];
    assert!(png["image/png"].is_object() && png["application/json"].is_null(), "{png}");
}

#[test]
fn every_change_may_meet_a_full_disk() {
    let document = document();
    let changes = |method: &str| ["delete", "patch", "post", "put"].contains(&method);
    for (method, path, operation) in operations(&document).filter(|(method, ..)| changes(method)) {
        let full = resolved(&document, &operation["responses"]["507"]);
        let description = full["description"].as_str().unwrap_or_default();
        assert!(description.contains("`storage-full`"), "{method} {path}");
        // A LiDAR map of earlier comes from the tenant's room, too.
        assert!(!path.ends_with("/restore") || description.contains("`tenant-full`"), "{path}");
    }
}

/// The level `main` may be the ninth one.
#[test]
fn both_ways_to_send_a_lidar_map_may_meet_the_maximum_of_levels() {
    let document = document();
    for path in ["/v1/homes/{home}/lidar-map", "/v1/homes/{home}/lidar-maps/{level}"] {
        let answer = resolved(&document, &document["paths"][path]["put"]["responses"]["409"]);
        assert!(answer["description"].as_str().unwrap_or_default().contains("`too-many-levels`"), "{path}");
    }
}

/// Collects every `$ref` in a part of the document.
fn references(part: &Value, into: &mut Vec<String>) {
    match part {
        Value::Object(members) => {
            into.extend(members.get("$ref").and_then(|name| name.as_str()).map(str::to_owned));
            members.values().for_each(|member| references(member, into));
        }
        Value::Array(items) => items.iter().for_each(|item| references(item, into)),
        _ => {}
    }
}

#[test]
fn nothing_is_referred_to_that_is_not_there() {
    let document = document();
    let mut named = Vec::new();
    references(&document, &mut named);
    assert!(named.len() > 100);
    for name in named {
        assert!(document.pointer(name.strip_prefix('#').unwrap()).is_some(), "{name}");
    }
}

#[test]
fn every_schema_and_every_answer_has_an_example() {
    let document = document();
    let has_example = |part: &Value| part.get("example").is_some() || part.get("examples").is_some();
    for (name, schema) in document["components"]["schemas"].as_object().unwrap() {
        assert!(has_example(schema) || name == "FileBytes", "{name}");
        let members = schema["properties"].as_object().into_iter().flatten();
        for (member, _) in members.filter(|_| schema["examples"].is_array()) {
            assert!(schema["examples"][0].get(member).is_some(), "{name}.{member}");
        }
    }
    let types = &document["components"]["schemas"]["Problem"]["properties"]["type"]["enum"];
    let types = types.as_array().unwrap();
    let mut count = 0;
    for (method, path, operation) in operations(&document) {
        for (status, answer) in answers(&document, operation) {
            for (media_type, content) in answer["content"].as_object().into_iter().flatten() {
                let is_file = content["schema"]["$ref"] == "#/components/schemas/FileBytes";
                let is_text = content["schema"]["type"] == "string";
                let what = format!("{method} {path} {status} {media_type}");
                assert!(has_example(content) || is_file || is_text, "{what}");
                count += 1;
                if media_type == "application/problem+json" {
                    assert_eq!(content["example"]["status"].to_string(), status, "{what}");
                    assert!(types.contains(&content["example"]["type"]), "{what}");
                }
            }
        }
    }
    assert!(count > 300, "{count}");
    // The example of a document is written once, whatever the number of operations that answer with it.
    let clip = document["components"]["examples"]["Clip"]["value"]["sha256"].to_string();
    let text = serde_json::to_string(&document["paths"]).unwrap();
    assert!(clip.len() > 60 && !text.contains(&clip));
    assert_eq!(document["servers"][0]["url"], "/");
}

#[tokio::test]
async fn pages_load_nothing_from_elsewhere() {
    let server = Server::start().await;
    let pages =
        [("/", "text/html"), ("/docs/", "text/html"), ("/docs/swagger-initializer.js", "text/javascript")];
    for (path, media_type) in pages {
        let page = server.get(path).await;
        assert_eq!(page.status, 200, "{path}");
        assert!(page.header("content-type").starts_with(media_type), "{path}");
        let text = String::from_utf8(page.bytes).unwrap();
        assert!(!text.contains("http://") && !text.contains("https://"), "{path} names another host");
    }
}

#[tokio::test]
async fn the_viewer_is_kept_by_browsers_and_bound_to_this_host() {
    let server = Server::start().await;
    let page = server.get("/").await;
    let policy = page.header("content-security-policy").to_owned();
    assert!(policy.contains("default-src 'none'") && policy.contains("script-src 'self';"), "{policy}");
    assert!(!policy.contains("unsafe") && !policy.contains("http") && !policy.contains('*'), "{policy}");
    assert_eq!(server.get_with("/", "if-none-match", page.header("etag")).await.status, 304);

    // An address typed without the `#` leads to the page.
    assert_eq!(server.get("/homes/flat").await.bytes, page.bytes);

    // Without Node.js at the build the page has no assets, and says so.
    let html = String::from_utf8(page.bytes).unwrap();
    for asset in html.split('"').filter(|part| part.starts_with("/assets/")) {
        let answer = server.get(asset).await;
        let is_style = asset.ends_with(".css");
        assert_eq!(answer.status, 200, "{asset}");
        let media_type = if is_style { "text/css" } else { "text/javascript" };
        assert!(answer.header("content-type").starts_with(media_type), "{asset}");
        assert!(answer.header("cache-control").contains("immutable"), "{asset}");
    }
    assert!(html.contains("/assets/") || html.contains("built without the viewer"), "{html}");
    for path in ["/assets/none.js", "/assets/%2e%2e%2flist.rs", "/assets/%ff", "/assets/"] {
        server.get(path).await.problem(404, "route-not-found");
    }
}

#[tokio::test]
async fn classes_are_told_as_points_carry_them() {
    let server = Server::start().await;
    let answer = server.get("/v1/classes").await.ok(200);
    let classes = answer["classes"].as_array().unwrap();
    assert_eq!(classes.len(), viola_geometry::taxonomy::Class::ALL.len());
    for (class, known) in classes.iter().zip(viola_geometry::taxonomy::Class::ALL) {
        assert_eq!((&class["id"], &class["name"]), (&known.id().into(), &known.name().into()));
        let color = class["color"].as_str().unwrap().strip_prefix('#').unwrap();
        let [_, red, green, blue] = u32::from_str_radix(color, 16).unwrap().to_be_bytes();
        assert_eq!([red, green, blue], known.color());
    }
}
