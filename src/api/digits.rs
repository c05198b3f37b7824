//! Documents as JSON. Numbers have the digits that mean something: 0.1 mm, 0.0001 of a probability, 0.1 ms.

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};
use std::io::{self, Write};

/// Numbers of at least this size are sent as they are: their last digit is above the fourth decimal.
const LARGE: f64 = 1e11;

/// Returns a document as JSON.
pub(super) fn json<T: Serialize + ?Sized>(document: &T) -> Vec<u8> {
    written(document, CompactFormatter)
}

/// Returns a document as JSON with indented lines.
pub fn pretty_json<T: Serialize + ?Sized>(document: &T) -> Vec<u8> {
    written(document, PrettyFormatter::new())
}

fn written<T: Serialize + ?Sized>(document: &T, layout: impl Formatter) -> Vec<u8> {
    let mut text = Vec::with_capacity(512);
    document
        .serialize(&mut Serializer::with_formatter(&mut text, Digits(layout)))
        .expect("our own records have text keys and cannot fail to serialise");
    text
}

/// Writes JSON in a layout, with [`rounded`] numbers.
struct Digits<F>(F);

macro_rules! as_in_the_layout {
    ($($method:ident($($first:ident)?)),*) => {
        $(fn $method<W: Write + ?Sized>(&mut self, writer: &mut W $(, $first: bool)?) -> io::Result<()> {
            self.0.$method(writer $(, $first)?)
        })*
    };
}

impl<F: Formatter> Formatter for Digits<F> {
    as_in_the_layout!(
        begin_array(),
        end_array(),
        begin_array_value(first),
        end_array_value(),
        begin_object(),
        end_object(),
        begin_object_key(first),
        begin_object_value(),
        end_object_value()
    );

    fn write_f32<W: Write + ?Sized>(&mut self, writer: &mut W, value: f32) -> io::Result<()> {
        self.write_f64(writer, f64::from(value))
    }

    fn write_f64<W: Write + ?Sized>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        self.0.write_f64(writer, rounded(value))
    }
}

/// Returns a number with four decimals, a small one with four significant digits.
fn rounded(value: f64) -> f64 {
    let size = value.abs();
    if size >= LARGE {
        value
    } else if size >= 0.1 {
        (value * 1e4).round() / 1e4
    } else {
        format!("{value:.3e}").parse().unwrap_or(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_mean_something() {
        for (value, want) in [
            (12.345_678_9, "12.3457"),
            (-0.1, "-0.1"),
            (0.987_654_32, "0.9877"),
            (0.012_345_678, "0.01235"),
            (-1.234_567e-7, "-1.235e-7"),
            (0.0, "0.0"),
            (3.0, "3.0"),
            (1.5e12, "1500000000000.0"),
            (f64::NAN, "null"),
        ] {
            assert_eq!(String::from_utf8(json(&value)).unwrap(), want);
        }
        assert_eq!(json(&[0.1f32, 2.7f32]), b"[0.1,2.7]");
        assert_eq!(json(&serde_json::json!({"a": [1, "b", null]})), br#"{"a":[1,"b",null]}"#);
        let pretty = pretty_json(&serde_json::json!({"a": [1, 7.350_000_000_000_000_5], "b": {}, "c": 2}));
        assert_eq!(pretty, b"{\n  \"a\": [\n    1,\n    7.35\n  ],\n  \"b\": {},\n  \"c\": 2\n}");
    }
}
