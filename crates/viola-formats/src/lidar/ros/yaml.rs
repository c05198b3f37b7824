//! The yaml file of a ROS map.
//!
//! map_server reads it with yaml-cpp, which converts the text of a value, whether it is in quotes or not, and takes more
//! words for true and false than YAML 1.2.

use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, Unexpected, Visitor};
use std::fmt;
use viola_geometry::Pose2;

#[derive(Deserialize)]
pub(super) struct Description {
    pub image: String,
    #[serde(deserialize_with = "number")]
    pub resolution: f64,
    #[serde(deserialize_with = "three_numbers")]
    pub origin: [f64; 3],
    #[serde(default, deserialize_with = "switch")]
    pub negate: bool,
    #[serde(deserialize_with = "number")]
    pub occupied_thresh: f64,
    #[serde(deserialize_with = "number")]
    pub free_thresh: f64,
    #[serde(default)]
    pub mode: Mode,
}

/// The members that tell the yaml file of a map or a mask from those of other programs.
#[derive(Deserialize)]
struct Members {
    image: Option<IgnoredAny>,
    resolution: Option<IgnoredAny>,
}

#[derive(Deserialize, Default, Clone, Copy, PartialEq)]
#[serde(try_from = "String")]
pub(super) enum Mode {
    #[default]
    Trinary,
    Scale,
    Raw,
}

impl TryFrom<String> for Mode {
    type Error = String;

    /// Parses a mode in letters of either case, as map_server does.
    fn try_from(name: String) -> Result<Mode, String> {
        match name.to_ascii_lowercase().as_str() {
            "trinary" => Ok(Mode::Trinary),
            "scale" => Ok(Mode::Scale),
            "raw" => Ok(Mode::Raw),
            _ => Err(format!("mode is trinary, scale or raw, and not {name}")),
        }
    }
}

/// Converts the text of a value.
struct Text<T> {
    parse: fn(&str) -> Option<T>,
    expected: &'static str,
}

impl<T> Visitor<'_> for Text<T> {
    type Value = T;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(self.expected)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        (self.parse)(text.trim()).ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}

struct Number(f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Number, D::Error> {
        number(deserializer).map(Number)
    }
}

fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    // yaml-cpp writes what is not a number with a point in front.
    let parse = |text: &str| match text {
        ".nan" | ".NaN" | ".NAN" => Some(f64::NAN),
        number => number.parse().ok(),
    };
    deserializer.deserialize_str(Text::<f64> { parse, expected: "a number" })
}

fn three_numbers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    <[Number; 3]>::deserialize(deserializer).map(|numbers| numbers.map(|Number(number)| number))
}

fn switch<'de, D: Deserializer<'de>>(deserializer: D) -> Result<bool, D::Error> {
    let parse = |text: &str| match text.to_ascii_lowercase().as_str() {
        "true" | "yes" | "on" | "y" => Some(true),
        "false" | "no" | "off" | "n" | "" => Some(false),
        number => number.parse::<i64>().ok().map(|number| number != 0),
    };
    deserializer.deserialize_str(Text::<bool> { parse, expected: "0, 1, true or false" })
}

/// Returns a text without its byte order mark. The reader of YAML counts it as a column, so that the first line would be
/// indented.
fn without_mark(yaml: &[u8]) -> &[u8] {
    yaml.strip_prefix(b"\xef\xbb\xbf").unwrap_or(yaml)
}

impl Description {
    pub fn parse(yaml: &[u8]) -> Result<Description, String> {
        serde_yaml_ng::from_slice(without_mark(yaml)).map_err(|error| error.to_string())
    }

    /// Returns whether a yaml file is that of a map or a mask, and not another program's. A damaged one has at least one of
    /// the two members: a mask beside a damaged map must not be taken for it.
    pub fn is_in(yaml: &[u8]) -> bool {
        let yaml = without_mark(yaml);
        match serde_yaml_ng::from_slice::<Members>(yaml) {
            Ok(members) => members.image.is_some() || members.resolution.is_some(),
            Err(_) => yaml
                .split(|byte| *byte == b'\n')
                .any(|line| line.starts_with(b"image:") || line.starts_with(b"resolution:")),
        }
    }

    /// Returns whether the yaw is not a number. map_saver writes `-nan` for a map whose publisher left the rotation empty, as
    /// octomap's does (ros-planning/navigation, issue 993).
    pub fn has_no_yaw(&self) -> bool {
        self.origin[2].is_nan()
    }

    /// Checks the numbers and returns the pose of the image's lower-left corner in the map. Without a yaw it is 0.
    pub fn origin(&self) -> Result<Pose2, String> {
        let Description { resolution, mut origin, occupied_thresh, free_thresh, .. } = *self;
        if self.has_no_yaw() {
            origin[2] = 0.0;
        }
        if !(0.001..=1.0).contains(&resolution) {
            return Err(format!(
                "resolution is {resolution}, and must be from 0.001 to 1 metre for each pixel"
            ));
        }
        let [x_m, y_m, yaw_rad] = origin;
        if !origin.iter().all(|value| value.abs() < 1e6) {
            return Err(format!("origin is {origin:?}, and its values must be below 1e6"));
        }
        if !(0.0 <= free_thresh && free_thresh < occupied_thresh && occupied_thresh <= 1.0) {
            return Err(format!(
                "free_thresh is {free_thresh} and occupied_thresh is {occupied_thresh}; 0 <= free < occupied <= 1 must hold"
            ));
        }
        Ok(Pose2::new(x_m, y_m, yaw_rad))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "image: map.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
        free_thresh: 0.196\n";

    fn edited(from: &str, to: &str) -> Result<Description, String> {
        assert!(GOOD.contains(from), "{from}");
        Description::parse(GOOD.replace(from, to).as_bytes())
    }

    #[test]
    fn values_are_read_as_map_server_reads_them() {
        for (text, negate) in [
            ("0", false),
            ("1", true),
            ("\"0\"", false),
            ("'1'", true),
            ("no", false),
            ("No", false),
            ("yes", true),
            ("off", false),
            ("ON", true),
            ("false", false),
            ("\"true\"", true),
            ("", false),
            ("1 # white is occupied", true),
        ] {
            let read = edited("negate: 0", &format!("negate: {text}"));
            assert_eq!(read.map(|description| description.negate), Ok(negate), "{text}");
        }
        let other = "# saved by hand\n---\nimage: 'map.pgm' # the image\nresolution: \"0.05\"\n\
            origin: [\"-1.0\", 2, '0.0']\noccupied_thresh: '0.65'\nfree_thresh: \" .196\"\n";
        for yaml in
            [GOOD.to_string(), other.to_string(), format!("\u{feff}{GOOD}"), GOOD.replace('\n', "\r\n")]
        {
            let read = Description::parse(yaml.as_bytes()).unwrap_or_else(|error| panic!("{yaml}: {error}"));
            assert_eq!(
                (read.image.as_str(), read.resolution, read.origin),
                ("map.pgm", 0.05, [-1.0, 2.0, 0.0])
            );
            assert_eq!((read.occupied_thresh, read.free_thresh, read.negate), (0.65, 0.196, false), "{yaml}");
        }
    }

    #[test]
    fn files_of_other_programs_are_told() {
        for (yaml, is_told) in [
            (GOOD, true),
            ("\u{feff}resolution: 0.05\n", true),
            ("image: map.pgm\norigin: [\n", true),
            ("{resolution: 0.05, image: map.pgm}", true),
            ("amcl:\n  ros__parameters:\n    resolution: 0.05\n", false),
            ("- image\n", false),
            ("rooms: [\n", false),
            ("image:\n", false),
            ("", false),
        ] {
            assert_eq!(Description::is_in(yaml.as_bytes()), is_told, "{yaml}");
        }
    }

    #[test]
    fn errors_name_the_field() {
        for (from, to, field) in [
            ("0.65", "most", "occupied_thresh"),
            ("0.196", "[0.196]", "free_thresh"),
            ("negate: 0", "negate: maybe", "negate"),
            ("[-1.0, 2.0, 0.0]", "[-1.0, 2.0]", "origin"),
            ("[-1.0, 2.0, 0.0]", "[-1.0, 2.0, 0.0, 0.0]", "origin"),
            ("[-1.0, 2.0, 0.0]", "[-1.0, far, 0.0]", "origin[1]"),
            ("0.05", "5 cm", "resolution"),
        ] {
            let error = edited(from, to).err().unwrap_or_default();
            assert!(error.starts_with(field), "{to}: {error}");
        }
    }
}
