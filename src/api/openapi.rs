//! Additions of the OpenAPI document to the operations' own descriptions: an example for every schema and every JSON
//! answer, the types of problems, conditional requests, and ranges of files.

mod examples;

use super::error::CODES;
use examples::Examples;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use utoipa::openapi::OpenApi;

const FILE: &str = "#/components/schemas/FileBytes";
const PROBLEM: &str = "application/problem+json";
/// Values of `If-Match` (RFC 9110, section 13.1.1).
const TAGS: &str = r#"^(\*|(W/)?"[!#-~]*"(, *(W/)?"[!#-~]*")*)$"#;

/// Returns the whole document.
pub(super) fn complete(document: &OpenApi) -> OpenApi {
    let mut document = serde_json::to_value(document).expect("the document has text keys");
    document["servers"] = json!([{"url": "/", "description": "The service that serves this document"}]);
    list_problem_types(&mut document);
    let examples = Examples::of(&mut document);
    let mut shared = Map::new();
    for (path, operations) in members(document.get_mut("paths")) {
        for (method, operation) in members(Some(operations)) {
            if method == "get" && path.starts_with("/v1/") {
                allow_conditions(operation);
            }
            if ["delete", "patch", "post", "put"].contains(&method.as_str()) {
                tell_full_disk(operation);
            }
            demand_values(operation);
            give_pattern(operation);
            for (status, answer) in members(operation.get_mut("responses")) {
                if status.as_str() >= "400" {
                    answer["content"] =
                        json!({PROBLEM: {"schema": {"$ref": "#/components/schemas/Problem"}}});
                }
                tell_delay(answer, status);
                show_answer(answer, status, &examples, &mut shared);
            }
        }
    }
    document["components"]["examples"] = Value::Object(shared);
    share_problems(&mut document);
    describe_messages(&mut document);
    serde_json::from_value(document).expect("it is the document with more members of the same kinds")
}

/// Moves every problem that several operations answer with to `components.responses`, named by its status: `Problem400`,
/// `Problem400b`. Repeated, they would be half of the document.
fn share_problems(document: &mut Value) {
    let mut problems: Vec<(String, &mut Value)> = Vec::new();
    for (_, operations) in members(document.get_mut("paths")) {
        for (_, operation) in members(Some(operations)) {
            let answers = members(operation.get_mut("responses"));
            let of_problem = answers.filter(|(_, answer)| answer["content"].get(PROBLEM).is_some());
            problems.extend(of_problem.map(|(status, answer)| (status.clone(), answer)));
        }
    }
    let mut uses: BTreeMap<(String, String), Vec<&mut Value>> = BTreeMap::new();
    for (status, answer) in problems {
        uses.entry((status, answer.to_string())).or_default().push(answer);
    }
    let mut shared = Map::new();
    for ((status, _), answers) in uses.into_iter().filter(|(_, answers)| answers.len() > 1) {
        let suffixes = std::iter::once(String::new()).chain(('b'..='z').map(String::from));
        let mut names = suffixes.map(|suffix| format!("Problem{status}{suffix}"));
        let Some(name) = names.find(|name| !shared.contains_key(name)) else { continue };
        let reference = json!({"$ref": format!("#/components/responses/{name}")});
        for answer in answers {
            shared.insert(name.clone(), std::mem::replace(answer, reference.clone()));
        }
    }
    document["components"]["responses"] = Value::Object(shared);
}

/// Adds the events of streams and the messages to webhooks.
fn describe_messages(document: &mut Value) {
    for (path, event) in [("/v1/homes/{home}/events", "HomeEvent"), ("/v1/jobs/{job}/events", "JobEvent")] {
        // OpenAPI 3.1 has no place for the items of a stream.
        let stream = &mut document["paths"][path]["get"]["responses"]["200"]["content"]["text/event-stream"];
        stream["x-item-schema"] = json!({"$ref": format!("#/components/schemas/{event}")});
    }
    document["webhooks"] = json!({
        "change": webhook("on_change", "Receive a change of a home or of something in it", "WebhookMessage"),
        "test": webhook("on_webhook_test", "Receive the message of a test", "WebhookTest"),
    });
}

/// Returns the request that a webhook receives.
fn webhook(operation: &str, summary: &str, body: &str) -> Value {
    let header = |name: &str, description: &str| {
        let schema = json!({"type": "string"});
        json!({"name": name, "in": "header", "required": true, "schema": schema, "description": description})
    };
    let schema = json!({"$ref": format!("#/components/schemas/{body}")});
    json!({"post": {
        "tags": ["webhooks"],
        "summary": summary,
        "operationId": operation,
        "parameters": [
            header("webhook-id", "Id of the message, the same in each attempt"),
            header("webhook-timestamp", "Seconds since 1970 UTC"),
            header("webhook-signature", "`v1,` and the base64 of the HMAC-SHA256 of `ID.TIMESTAMP.BODY` by the webhook's secret"),
        ],
        "requestBody": {"required": true, "content": {"application/json": {"schema": schema}}},
        "responses": {
            "204": {"description": "The message has arrived; any other 2xx says so, too"},
            "410": {"description": "The address wants no more messages: the webhook is disabled"},
            "503": {"description": "As any other status: the message is sent again, after `Retry-After` if that is given"},
        },
        "security": [],
    }})
}

/// Returns the members of an object; none of anything else.
fn members(value: Option<&mut Value>) -> impl Iterator<Item = (&String, &mut Value)> {
    value.and_then(Value::as_object_mut).into_iter().flat_map(Map::iter_mut)
}

fn list_problem_types(document: &mut Value) {
    let types = CODES.iter().map(|code| kind(&code.replace('_', "-")));
    document["components"]["schemas"]["Problem"]["properties"]["type"]["enum"] = types.collect();
}

/// Returns the type of a problem from its code with hyphens.
fn kind(code: &str) -> String {
    format!("urn:viola:problem:{code}")
}

/// Adds the pattern of `If-Match`, which is refused without it.
fn give_pattern(operation: &mut Value) {
    for parameter in operation["parameters"].as_array_mut().into_iter().flatten() {
        if parameter["name"] == "If-Match" {
            parameter["schema"]["pattern"] = json!(TAGS);
        }
    }
}

/// Adds the entity tag, the conditions, and the answers of a request that has the answer already or wants another one. Streams
/// have no entity tag.
fn allow_conditions(operation: &mut Value) {
    let is_stream = |kind: &String| ["text/event-stream", "application/zip"].contains(&kind.as_str());
    let contents = operation["responses"]["200"]["content"].as_object().cloned().unwrap_or_default();
    if contents.keys().all(is_stream) {
        return;
    }
    let condition = "The `ETag` of an earlier answer: the answer is 304 if nothing has changed";
    add_header(operation, "If-None-Match", &json!({"type": "string"}), condition);
    let unless_another = "The `ETag` of the answer as it was read: another one gets 412";
    add_header(operation, "If-Match", &json!({"type": "string"}), unless_another);
    operation["responses"]["412"] =
        json!({"description": "The answer would be another one: `changed-meanwhile`"});
    operation["responses"]["200"]["headers"]["ETag"] = entity_tag();
    if operation["responses"]["304"].is_null() {
        operation["responses"]["304"] = json!({"description": "The client has it"});
    }
    let files: Map<String, Value> =
        contents.into_iter().filter(|(_, content)| content["schema"]["$ref"] == FILE).collect();
    if !files.is_empty() {
        allow_ranges(operation, files);
    }
}

/// Adds the answer of an operation that changes something while the disk is full.
fn tell_full_disk(operation: &mut Value) {
    if operation["responses"]["507"].is_null() {
        operation["responses"]["507"] = json!({"description": "`storage-full`"});
    }
}

/// Adds the headers and the answers of a request for a part of one of `files`.
fn allow_ranges(operation: &mut Value, files: Map<String, Value>) {
    let range = "One range of bytes. The whole file comes for several ranges, and for a file of text or points if the \
        client also accepts a compressed one";
    add_header(operation, "Range", &json!({"type": "string", "examples": ["bytes=0-1023"]}), range);
    let unless_changed = "The `ETag` of the file of which the client has a part: another file comes whole";
    add_header(operation, "If-Range", &json!({"type": "string"}), unless_changed);
    let place = json!({"description": "Place of the bytes, and size of the whole file", "schema": {"type": "string"}});
    operation["responses"]["206"] = json!({
        "description": "The bytes of the range",
        "headers": {"Content-Range": place, "ETag": entity_tag()},
        "content": files,
    });
    let behind = "The range begins behind the end of the file: `range-not-satisfiable`";
    operation["responses"]["416"] = json!({"description": behind});
}

/// Adds a header that a request may have.
fn add_header(operation: &mut Value, name: &str, schema: &Value, description: &str) {
    let header = json!({"name": name, "in": "header", "required": false, "schema": schema, "description": description});
    match operation["parameters"].as_array_mut() {
        Some(parameters) => parameters.push(header),
        None => operation["parameters"] = json!([header]),
    }
}

/// Returns the description of the header of an answer with an entity tag.
fn entity_tag() -> Value {
    json!({"description": "Names the content, for conditional requests", "schema": {"type": "string"}})
}

/// Removes null from the types of headers and files: one is absent or has a value.
fn demand_values(operation: &mut Value) {
    for (_, content) in members(operation.get_mut("requestBody").and_then(|body| body.get_mut("content"))) {
        let mut choices = content["schema"]["oneOf"].as_array().into_iter().flatten();
        if let Some(file) = choices.find(|choice| choice["$ref"] == FILE).cloned() {
            content["schema"] = file;
        }
    }
    for parameter in operation.get_mut("parameters").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(types) = parameter["schema"]["type"].as_array()
            && let Some(kind) = types.iter().find(|kind| *kind != "null").cloned()
        {
            parameter["schema"]["type"] = kind;
        }
    }
}

/// Adds the header of an answer to a request that may succeed later.
fn tell_delay(answer: &mut Value, status: &str) {
    if ["429", "503"].contains(&status) {
        let description = "Seconds after which a retry may succeed, if the service knows them";
        answer["headers"]["Retry-After"] =
            json!({"description": description, "schema": {"type": "integer", "minimum": 1}});
    }
}

/// Adds an example to an answer. The examples of documents with a name are in `components.examples`, since many
/// operations answer with the same document.
fn show_answer(answer: &mut Value, status: &str, examples: &Examples, shared: &mut Map<String, Value>) {
    // The first code of the description stands for the others.
    let description = answer["description"].as_str().unwrap_or_default().to_owned();
    for (media_type, content) in members(answer.get_mut("content")) {
        let example = match media_type.as_str() {
            PROBLEM => Some(problem(&description, status)),
            kind if kind.ends_with("json") => examples.of_schema(&content["schema"]),
            _ => None,
        };
        let Some(example) = example else { continue };
        let named = content["schema"]["$ref"].as_str().and_then(|target| target.rsplit('/').next());
        match named.filter(|_| media_type != PROBLEM) {
            Some(name) => {
                let name = name.to_owned();
                content["examples"] = json!({&name: {"$ref": format!("#/components/examples/{name}")}});
                shared.insert(name, json!({"value": example}));
            }
            None => content["example"] = example,
        }
    }
}

fn problem(description: &str, status: &str) -> Value {
    let of_code = |code: &&str| CODES.contains(code.replace('-', "_").as_str());
    let code = description.split('`').skip(1).step_by(2).find(of_code).unwrap_or("invalid-query");
    let title = description.split([':', ';']).next().unwrap_or_default().trim_matches(['`', ' ']);
    json!({"type": kind(code), "title": title, "status": status.parse::<u16>().unwrap_or(500), "detail": description})
}
