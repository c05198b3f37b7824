//! Examples of schemas: their own, or made of those of their parts.

use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Depth of the parts that are shown: no answer is deeper.
const MAX_DEPTH: usize = 24;

/// The examples of the document's schemas.
pub(super) struct Examples {
    schemas: Map<String, Value>,
    /// Examples of members by their names, for schemas without an example of their own.
    by_name: BTreeMap<String, Value>,
}

impl Examples {
    /// Adds an example to every schema of a document that has none, and returns them.
    pub fn of(document: &mut Value) -> Examples {
        let by_name = serde_json::from_str(include_str!("examples.json")).expect("the file is checked in");
        let schemas = document["components"]["schemas"].as_object().cloned().unwrap_or_default();
        let mut examples = Examples { schemas, by_name };
        for name in examples.schemas.keys().cloned().collect::<Vec<_>>() {
            let schema = &examples.schemas[&name];
            if own(schema).is_none()
                && let Some(example) = examples.of_part(schema, None, 0)
            {
                document["components"]["schemas"][&name]["examples"] = json!([example]);
            }
        }
        if let Some(schemas) = document["components"]["schemas"].as_object() {
            examples.schemas = schemas.clone();
        }
        examples
    }

    /// Returns an example of a schema; `None` for the bytes of a file.
    pub fn of_schema(&self, schema: &Value) -> Option<Value> {
        self.of_part(schema, None, 0)
    }

    /// `name`: the member of which it is the schema.
    fn of_part(&self, schema: &Value, name: Option<&str>, depth: usize) -> Option<Value> {
        if depth > MAX_DEPTH {
            return None;
        }
        if let Some(own) = own(schema) {
            return Some(own);
        }
        if let Some(target) = schema["$ref"].as_str().and_then(|target| target.rsplit('/').next()) {
            return self.of_part(self.schemas.get(target)?, None, depth + 1);
        }
        for choice in ["oneOf", "anyOf"] {
            let one = schema[choice].as_array().into_iter().flatten().find(|one| one["type"] != "null");
            if let Some(one) = one {
                return self.of_part(one, name, depth + 1);
            }
        }
        if let Some(parts) = schema["allOf"].as_array() {
            let parts = parts.iter().filter_map(|part| self.of_part(part, name, depth + 1));
            let parts = parts.filter_map(|part| part.as_object().cloned());
            return Some(Value::Object(parts.flatten().collect()));
        }
        if let Some(first) = schema["enum"].as_array().and_then(|all| all.first()) {
            return Some(first.clone());
        }
        match type_of(schema) {
            "object" => Some(self.of_object(schema, depth)),
            "array" => self.by_name(name, schema).or_else(|| {
                let item = self.of_part(&schema["items"], None, depth + 1)?;
                Some(Value::Array(vec![item; schema["minItems"].as_u64().unwrap_or(1) as usize]))
            }),
            "string" => match schema["format"].as_str() {
                Some("binary") => None,
                Some("date-time") => Some(json!("2026-03-14T15:09:26Z")),
                Some("uuid") => Some(json!("01a1f766-7a97-7747-9dbb-391e0eeccb64")),
                _ => self.by_name(name, schema),
            },
            "boolean" => Some(json!(true)),
            "integer" => self.by_name(name, schema).or_else(|| Some(json!(1))),
            "number" => self.by_name(name, schema).or_else(|| Some(json!(0.1))),
            _ => Some(json!({})),
        }
    }

    fn of_object(&self, schema: &Value, depth: usize) -> Value {
        let mut example = Map::new();
        for (name, member) in schema["properties"].as_object().into_iter().flatten() {
            if let Some(value) = self.of_part(member, Some(name), depth + 1) {
                example.insert(name.clone(), value);
            }
        }
        if example.is_empty() && schema["additionalProperties"].is_object() {
            example.extend(
                self.of_part(&schema["additionalProperties"], None, depth + 1)
                    .map(|value| ("search".to_owned(), value)),
            );
        }
        Value::Object(example)
    }

    /// Returns the example of a member, if it is one of the schema: members of other types may have the same name.
    fn by_name(&self, name: Option<&str>, schema: &Value) -> Option<Value> {
        self.by_name.get(name?).filter(|value| fits(value, schema)).cloned()
    }
}

/// Returns whether a value has the type of a schema and, as a list, its number of items.
fn fits(value: &Value, schema: &Value) -> bool {
    match (type_of(schema), value) {
        ("array", Value::Array(items)) => {
            let count = items.len() as u64;
            schema["minItems"].as_u64().is_none_or(|least| count >= least)
                && schema["maxItems"].as_u64().is_none_or(|most| count <= most)
        }
        ("string", value) => value.is_string(),
        ("integer", value) => value.is_i64(),
        ("number", value) => value.is_number(),
        _ => false,
    }
}

fn own(schema: &Value) -> Option<Value> {
    let first = schema["examples"].as_array().and_then(|all| all.first());
    first.or_else(|| schema.get("example")).cloned()
}

/// Returns the type of a schema that is not null.
fn type_of(schema: &Value) -> &str {
    match &schema["type"] {
        Value::Array(types) => types.iter().filter_map(Value::as_str).find(|kind| *kind != "null"),
        kind => kind.as_str(),
    }
    .unwrap_or_default()
}
