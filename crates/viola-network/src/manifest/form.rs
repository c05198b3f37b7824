//! The TOML form of a manifest entry, and its checks.

use super::{Diffusion, ManifestError, ModelEntry, Task};
use crate::Weights;
use serde::{Deserialize, Serialize};
use std::path::{Component, Path, PathBuf};
use viola_geometry::taxonomy::ClassTable;

/// Maximum length of a text field, in bytes.
const MAX_TEXT_BYTES: usize = 2000;
/// Maximum side of a network's picture, in pixels.
const MAX_SIDE: usize = 4096;
/// Maximum number of channels before the first class.
const MAX_FIRST_CLASS: usize = 1000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    #[serde(default)]
    pub(super) network: Vec<EntryForm>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EntryForm {
    name: String,
    task: Task,
    file: String,
    licence: String,
    input: Option<Input>,
    output: Option<Output>,
    classes: Option<ClassTable>,
    source: Source,
    sha256: Option<String>,
}

/// Conversion of a picture to a network's input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Name of the input in the file. Default: the network's only input.
    pub name: Option<String>,
    /// Pixels, or `any`: the file's size; if that is open, the size by `shortest`, `longest` and `multiple`.
    pub width: Side,
    pub height: Side,
    /// Mean of red, green and blue on the scale 0..1: the input is `(colour - mean) / std`.
    #[serde(default)]
    pub mean: [f32; 3],
    #[serde(default = "ones")]
    pub std: [f32; 3],
    #[serde(default)]
    pub layout: Layout,
    #[serde(default)]
    pub channels: Channels,
    /// For an open size: length of the picture's shorter side in the input.
    #[serde(default = "shortest")]
    pub shortest: usize,
    /// For an open size: maximum length of the longer side.
    #[serde(default = "longest")]
    pub longest: usize,
    /// For an open size: both sides of the input are padded to multiples of this.
    #[serde(default = "multiple")]
    pub multiple: usize,
}

fn ones() -> [f32; 3] {
    [1.0; 3]
}

fn shortest() -> usize {
    512
}

fn longest() -> usize {
    1024
}

fn multiple() -> usize {
    32
}

/// One side of a network's picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Side {
    Pixels(usize),
    Open(Any),
}

/// The word `any`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Any {
    Any,
}

impl Side {
    pub fn pixels(self) -> Option<usize> {
        match self {
            Side::Pixels(pixels) => Some(pixels),
            Side::Open(Any::Any) => None,
        }
    }
}

/// The order of an input's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Picture, colour, row, column.
    #[default]
    Nchw,
    /// Picture, row, column, colour.
    Nhwc,
}

/// The order of an input's colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channels {
    #[default]
    Rgb,
    Bgr,
}

/// Meaning of a network's output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Output {
    /// One value for each class and pixel: 1 x classes x height x width.
    Logits {
        /// Name of the output in the file. Default: the network's only output.
        name: Option<String>,
        /// True if the centres of the corner pixels of output and input coincide, false if the edges do.
        #[serde(default)]
        align_corners: bool,
        /// Channel of the class table's id 0; channels before it are `other`.
        #[serde(default)]
        first_class: usize,
        /// True if the values are logits (default), false if they are probabilities.
        #[serde(default = "yes")]
        softmax: bool,
    },
    /// Class queries, 1 x queries x (classes + 1), and mask queries, 1 x queries x height x width
    /// (Cheng et al., 2022).
    Mask2former {
        #[serde(default = "class_queries")]
        class_queries: String,
        #[serde(default = "mask_queries")]
        mask_queries: String,
    },
    /// A depth for each pixel: 1 x 1 x height x width, or 1 x height x width.
    Depth {
        name: Option<String>,
        /// Factor from values to metres; for inverse depth, metres are `scale / value`.
        #[serde(default = "one")]
        scale: f32,
        /// True if the values grow towards the camera (inverse depth, disparity).
        #[serde(default)]
        inverse: bool,
    },
    /// The filled picture.
    Inpainting { name: Option<String>, mask: Option<String> },
    /// The filled picture, by a diffusion pipeline: the entry's file is its `pipeline.json`, and the networks
    /// lie in the same folder.
    Diffusion(Diffusion),
}

fn yes() -> bool {
    true
}

fn one() -> f32 {
    1.0
}

fn class_queries() -> String {
    "class_queries_logits".to_owned()
}

fn mask_queries() -> String {
    "masks_queries_logits".to_owned()
}

/// Source of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Source {
    /// A package of the npm registry, and the file in it.
    Npm { package: String, version: String, member: String, archive_sha256: Option<String> },
    /// A package of the Python registry, and the file in its wheel. Wheels differ by platform and Python
    /// version; the defaults are those of this computer.
    Pypi {
        package: String,
        version: String,
        member: String,
        platform: Option<String>,
        python: Option<String>,
        archive_sha256: Option<String>,
    },
    /// URL of the file, which must begin with `https://`; the entry needs the file's `sha256`.
    Https { url: String },
    /// The program has the file, and a file of this name in the models folder replaces it; `how` tells how it
    /// was made.
    #[serde(rename = "built-in")]
    BuiltIn { how: String },
    /// Instructions to make a file that cannot be fetched.
    Export { how: String },
}

/// The invalid field, and the reason.
type Problem = (&'static str, &'static str);

impl EntryForm {
    pub(super) fn check(self) -> Result<ModelEntry, ManifestError> {
        self.fields().map_err(|(field, problem)| {
            let network = self.name.chars().take(80).collect();
            ManifestError::Field { network, field, problem }
        })?;
        Ok(ModelEntry {
            name: self.name,
            task: self.task,
            file: PathBuf::from(self.file),
            licence: self.licence,
            input: self.input,
            output: self.output,
            classes: self.classes,
            source: self.source,
            sha256: self.sha256.map(|sum| sum.to_ascii_lowercase()),
        })
    }

    /// Checks the fields, and that they fit each other.
    fn fields(&self) -> Result<(), Problem> {
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if self.name.is_empty() || self.name.len() > 80 || !self.name.chars().all(plain) {
            return Err(("name", "must be 1 to 80 letters, digits, '-', '_' or '.'"));
        }
        for (field, text) in [("file", &self.file), ("licence", &self.licence)] {
            if text.is_empty() || text.len() > MAX_TEXT_BYTES {
                return Err((field, "must not be empty or longer than 2000 bytes"));
            }
        }
        let file = Path::new(&self.file);
        if !file.components().all(|part| matches!(part, Component::Normal(_))) || self.file.contains('\\') {
            return Err(("file", "must be a path inside the models folder, without '..'"));
        }
        let digits = "must be 64 hexadecimal digits";
        let whole = |sum: &String| sum.len() == 64 && sum.bytes().all(|b| b.is_ascii_hexdigit());
        if self.sha256.as_ref().is_some_and(|sum| !whole(sum)) {
            return Err(("sha256", digits));
        }
        self.source.check()?;
        if self.source.archive_sha256().is_some_and(|sum| !whole(sum)) {
            return Err(("source.archive_sha256", digits));
        }
        if matches!(self.source, Source::Https { .. }) && self.sha256.is_none() {
            return Err((
                "sha256",
                "must be given for a file that is fetched from a URL; `sha256sum FILE` prints it",
            ));
        }
        if self.source.is_built_in() && (self.sha256.is_none() || Weights::built_in(file).is_none()) {
            return Err(("source.kind", "is built-in, but the program has no such file; use another kind"));
        }
        let fits = matches!(
            (self.task, &self.output),
            (Task::Segmentation, Some(Output::Logits { .. } | Output::Mask2former { .. }))
                | (Task::Depth, Some(Output::Depth { .. }))
                | (Task::Inpainting, Some(Output::Inpainting { .. } | Output::Diffusion(_)))
                | (Task::Surface | Task::Runtime, None)
        );
        if !fits {
            return Err(("output", "does not fit the task"));
        }
        self.output.as_ref().map_or(Ok(()), Output::check)?;
        if (self.task == Task::Segmentation) != self.classes.is_some() {
            return Err(("classes", "belongs to segmentation networks, and they need it"));
        }
        if !matches!(self.task, Task::Surface | Task::Runtime) != self.input.is_some() {
            return Err(("input", "belongs to networks for pictures, and they need it"));
        }
        self.input.as_ref().map_or(Ok(()), Input::check)
    }
}

impl Input {
    fn check(&self) -> Result<(), Problem> {
        let side = |side: Side| side.pixels().is_none_or(|pixels| (1..=MAX_SIDE).contains(&pixels));
        if !side(self.width) {
            return Err(("input.width", "must be 1 to 4096 or \"any\""));
        }
        if !side(self.height) {
            return Err(("input.height", "must be 1 to 4096 or \"any\""));
        }
        if self.mean.iter().any(|m| !m.is_finite()) {
            return Err(("input.mean", "must be numbers"));
        }
        if self.std.iter().any(|s| !s.is_finite() || s.abs() < 1e-6) {
            return Err(("input.std", "must be numbers other than zero"));
        }
        if !(16..=MAX_SIDE).contains(&self.shortest) {
            return Err(("input.shortest", "must be 16 to 4096"));
        }
        if !(self.shortest..=MAX_SIDE).contains(&self.longest) {
            return Err(("input.longest", "must be at least input.shortest and at most 4096"));
        }
        if !(1..=256).contains(&self.multiple) {
            return Err(("input.multiple", "must be 1 to 256"));
        }
        Ok(())
    }
}

impl Output {
    fn check(&self) -> Result<(), Problem> {
        match self {
            Output::Logits { first_class, .. } if *first_class > MAX_FIRST_CLASS => {
                Err(("output.first_class", "must be at most 1000"))
            }
            Output::Depth { scale, .. } if !(scale.is_finite() && *scale > 0.0) => {
                Err(("output.scale", "must be a number above zero"))
            }
            Output::Diffusion(diffusion) => diffusion.check(),
            _ => Ok(()),
        }
    }
}

impl Source {
    /// Returns the SHA-256 of the package, if it is known.
    pub fn archive_sha256(&self) -> Option<&String> {
        match self {
            Source::Npm { archive_sha256, .. } | Source::Pypi { archive_sha256, .. } => {
                archive_sha256.as_ref()
            }
            Source::Https { .. } | Source::BuiltIn { .. } | Source::Export { .. } => None,
        }
    }

    /// Returns whether the program has the file.
    pub fn is_built_in(&self) -> bool {
        matches!(self, Source::BuiltIn { .. })
    }

    /// Checks the source. Package names are passed on command lines, so they must not look like options.
    fn check(&self) -> Result<(), Problem> {
        let name = |text: &str| {
            (1..=200).contains(&text.len())
                && text.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '@')
                && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_./@+!".contains(c))
        };
        match self {
            Source::Npm { package, version, member, .. } | Source::Pypi { package, version, member, .. } => {
                if !name(package) {
                    return Err(("source.package", "is not a package's name"));
                }
                if !name(version) || version.contains(['/', '@']) {
                    return Err(("source.version", "is not a version"));
                }
                if member.is_empty() || member.len() > 500 {
                    return Err(("source.member", "must name the file in the package"));
                }
                if let Source::Pypi { platform, python, .. } = self
                    && [platform, python].into_iter().flatten().any(|text| !name(text) || text.contains('/'))
                {
                    return Err((
                        "source.platform",
                        "is not a platform or version of Python as wheels name it",
                    ));
                }
            }
            Source::Https { url } => {
                if !url.starts_with("https://") || url.len() > MAX_TEXT_BYTES {
                    return Err((
                        "source.url",
                        "must begin with https:// and have at most 2000 bytes; for a file from elsewhere use kind = \"export\" and put it into the models folder",
                    ));
                }
            }
            Source::BuiltIn { how } | Source::Export { how } => {
                if how.is_empty() || how.len() > MAX_TEXT_BYTES {
                    return Err(("source.how", "must say how the file is made, in 2000 bytes"));
                }
            }
        }
        Ok(())
    }
}
