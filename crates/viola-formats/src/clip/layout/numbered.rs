//! Layouts with one file for each picture and pose, named by the frame's number.

use super::text::read_pose;
use super::{ClipError, ColorAt, DepthAt, Source, only_root};
use crate::clip::files::names_from;
use crate::container::Container;
use std::collections::{BTreeMap, BTreeSet};

/// Endings of pictures.
pub(super) const PICTURES: [&str; 3] = ["jpg", "jpeg", "png"];

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Color,
    Depth,
    Pose,
}

/// The parts of a file's name: the folder of the layout's root (with a `/` at its end, or empty), the kind of
/// file, and the frame's number.
pub(super) struct Part<'a> {
    pub root: &'a str,
    pub kind: Kind,
    pub number: u32,
}

/// The files of one clip by kind and frame number.
#[derive(Default)]
pub(super) struct Files<'a> {
    by_kind: [BTreeMap<u32, &'a str>; 3],
}

/// Sorts a container's names by root; `None` if no root has at least two kinds of files.
pub(super) fn find<'a>(
    container: &'a dyn Container,
    split: impl Fn(&'a str) -> Option<Part<'a>>,
) -> Result<Option<(&'a str, Files<'a>)>, ClipError> {
    let mut roots: BTreeMap<&str, Files> = BTreeMap::new();
    for name in container.names() {
        let Some(Part { root, kind, number }) = split(name) else { continue };
        let files = &mut roots.entry(root).or_default().by_kind[kind as usize];
        if let Some(first) = files.insert(number, name) {
            return Err(ClipError::DuplicateFrame { first: first.to_string(), second: name.clone() });
        }
    }
    roots.retain(|_, files| files.by_kind.iter().filter(|files| !files.is_empty()).count() >= 2);
    let Some(root) = only_root(roots.keys().copied())? else { return Ok(None) };
    Ok(roots.remove_entry(root))
}

impl Files<'_> {
    pub fn count(&self, kind: Kind) -> usize {
        self.by_kind[kind as usize].len()
    }

    /// Returns the frames with both pictures in the order of their numbers, and the number of the others. If
    /// there is no colour at all, depth is enough.
    pub fn sources(&self, container: &dyn Container) -> Result<(Vec<Source>, usize), ClipError> {
        let [color, depth, pose] = &self.by_kind;
        let numbers: BTreeSet<u32> = color.keys().chain(depth.keys()).copied().collect();
        let mut sources = Vec::new();
        for &number in &numbers {
            let (Some(color), Some(depth)) = (color_at(color, number), depth.get(&number)) else { continue };
            let world_from_camera = match pose.get(&number) {
                Some(name) => read_pose(container, name)?,
                None => None,
            };
            sources.push(Source {
                world_from_camera,
                ..Source::new(number, color, DepthAt::Png(depth.to_string()))
            });
        }
        let incomplete = numbers.len() - sources.len();
        Ok((sources, incomplete))
    }
}

/// Returns the files under a folder by the number that `number_of` gives for a name in lower case; numbers must be unique.
pub(super) fn numbered_under<'a>(
    container: &'a dyn Container,
    folder: &str,
    number_of: impl Fn(&str) -> Option<u32>,
) -> Result<BTreeMap<u32, &'a str>, ClipError> {
    let mut files = BTreeMap::new();
    for name in names_from(container, folder) {
        let Some(number) = number_of(&name[folder.len()..].to_ascii_lowercase()) else { continue };
        if let Some(first) = files.insert(number, name.as_str()) {
            return Err(ClipError::DuplicateFrame { first: first.to_string(), second: name.clone() });
        }
    }
    Ok(files)
}

/// Returns the files `NUMBER.ENDING` under a folder by their numbers, which must be unique.
pub(super) fn pictures_under<'a>(
    container: &'a dyn Container,
    folder: &str,
    endings: &[&str],
) -> Result<BTreeMap<u32, &'a str>, ClipError> {
    numbered_under(container, folder, |file| {
        let (stem, ending) = file.rsplit_once('.')?;
        number(stem).filter(|_| endings.contains(&ending))
    })
}

/// Returns the place of a frame's colour, which is absent if no frame has any; `None` if other frames have it.
pub(super) fn color_at(color: &BTreeMap<u32, &str>, number: u32) -> Option<ColorAt> {
    match color.get(&number) {
        Some(name) => Some(ColorAt::File(name.to_string())),
        None => color.is_empty().then_some(ColorAt::Absent),
    }
}

/// Parses a frame's number; only digits are allowed, not `+1` and `1e3`.
pub(super) fn number(digits: &str) -> Option<u32> {
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
}
