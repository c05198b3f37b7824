//! JSON objects as bodies. A parser of JSON keeps the last value of a repeated member, which may not be the one that its sender
//! means, so this one remembers the first repetition.

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::fmt;

/// A JSON object.
pub(super) struct Object {
    pub members: Map<String, Value>,
    /// Path of the first member, at any depth, that its object has twice.
    pub repeated: Option<String>,
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Object, D::Error> {
        let mut repeated = None;
        // Anything else than an object is refused at its first byte, however deep it is.
        let value = deserializer.deserialize_map(Reader { place: &Place::Body, repeated: &mut repeated })?;
        match value {
            Value::Object(members) => Ok(Object { members, repeated }),
            _ => Err(D::Error::custom("not a JSON object")),
        }
    }
}

/// Place of a value in the body. It has no path of its own: those of all values would take time by the square of the body.
enum Place<'a> {
    Body,
    Member(&'a Place<'a>, &'a str),
    Item(&'a Place<'a>, usize),
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Place::Body => Ok(()),
            Place::Member(Place::Body, name) => formatter.write_str(name),
            Place::Member(outer, name) => write!(formatter, "{outer}.{name}"),
            Place::Item(outer, index) => write!(formatter, "{outer}[{index}]"),
        }
    }
}

/// Reads the value at a place.
struct Reader<'a> {
    place: &'a Place<'a>,
    repeated: &'a mut Option<String>,
}

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a JSON object")
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        Ok(Value::from(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        loop {
            let place = &Place::Item(self.place, items.len());
            match sequence.next_element_seed(Reader { place, repeated: &mut *self.repeated })? {
                Some(item) => items.push(item),
                None => return Ok(Value::Array(items)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut members = Map::new();
        while let Some(name) = map.next_key::<String>()? {
            let place = &Place::Member(self.place, &name);
            let value = map.next_value_seed(Reader { place, repeated: &mut *self.repeated })?;
            if members.contains_key(&name) && self.repeated.is_none() {
                *self.repeated = Some(place.to_string());
            }
            members.insert(name, value);
        }
        Ok(Value::Object(members))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_repeated_member_is_found() {
        for (text, repeated) in [
            (r#"{}"#, None),
            (r#"{"a": 1, "b": {"a": [{"a": 2}, {"a": 3}]}}"#, None),
            (r#"{"a": 1, "b": 2, "a": 1}"#, Some("a")),
            (r#"{"a": 1, "\u0061": null}"#, Some("a")),
            (r#"{"pose": {"x_m": 1, "y_m": 2, "x_m": 3}, "pose": 7}"#, Some("pose.x_m")),
            (r#"{"list": [0, {"a": 1}, {"b": {"c": 1, "c": 2}}]}"#, Some("list[2].b.c")),
        ] {
            let object: Object = serde_json::from_str(text).unwrap();
            assert_eq!(object.repeated.as_deref(), repeated, "{text}");
        }
    }

    /// Anybody may send a body to `PUT /v1/session`. A path for each of these items would be 60 GB of text.
    #[test]
    fn many_items_of_a_member_with_a_long_name_are_read_at_once() {
        let (name, items) = ("n".repeat(1 << 18), vec!["0"; 1 << 18].join(","));
        let begun = std::time::Instant::now();
        let object: Object = serde_json::from_str(&format!("{{\"{name}\": [{items}]}}")).unwrap();
        assert_eq!(object.members[&name].as_array().unwrap().len(), 1 << 18);
        assert!(begun.elapsed().as_secs() < 3, "{:?}", begun.elapsed());
    }

    #[test]
    fn values_are_those_of_the_parser() {
        let text = r#"{"a": [null, true, -7, 18446744073709551615, 0.1, "\u00e9\n", [], {"b": -1e-3}]}"#;
        let object: Object = serde_json::from_str(text).unwrap();
        assert_eq!(Value::Object(object.members), serde_json::from_str::<Value>(text).unwrap());
        for other in ["7", "[]", "\"a\"", "true", "null"] {
            assert!(serde_json::from_str::<Object>(other).is_err(), "{other}");
        }
    }
}
