//! Messages between the work of a merge in a process of its own and its worker: JSON, and files beside it.

use super::describing::Earlier;
use super::error::MergeError;
use super::revision::Level;
use super::work::{Answer, Files, Log, Made, Request};
use crate::jobs::LevelFile;
use bytes::Bytes;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_home::{Manifest, TileKey};
use viola_storage::{LevelCoverage, MapObject, NewRevision, map_file};

/// Most files of one message.
const MAX_FILES: u64 = 1 << 20;

/// A message of the work.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Told {
    Request(Request),
    /// The last message: the new revision, `None` if the map stays as it was.
    Made(Option<Box<RevisionHead>>),
    /// The last message: the work failed.
    Failed(Failure),
}

/// An error of the work.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Failure {
    DamagedMap,
    DamagedClip(Uuid),
    Other(String),
}

/// A [`NewRevision`] without its files.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct RevisionHead {
    manifest: Manifest,
    tiles: Vec<TileKey>,
    sums: Vec<TileKey>,
    files: Vec<(LevelName, String)>,
    same_mesh_parts: Vec<LevelName>,
    objects: Vec<MapObject>,
    coverage: Vec<LevelCoverage>,
    has_object_changes: bool,
    log: Log,
}

/// An [`Answer`] without its files.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum AnswerHead {
    Files,
    /// Each level has one file, its LiDAR map.
    Levels(Option<Vec<(LevelName, Earlier)>>),
}

impl From<&MergeError> for Failure {
    fn from(error: &MergeError) -> Failure {
        match error {
            MergeError::DamagedMap => Failure::DamagedMap,
            MergeError::DamagedClip { clip } => Failure::DamagedClip(*clip),
            other => Failure::Other(other.to_string()),
        }
    }
}

impl From<Failure> for MergeError {
    fn from(failure: Failure) -> MergeError {
        match failure {
            Failure::DamagedMap => MergeError::DamagedMap,
            Failure::DamagedClip(clip) => MergeError::DamagedClip { clip },
            Failure::Other(cause) => MergeError::Told(cause),
        }
    }
}

impl RevisionHead {
    pub fn split(made: Made) -> (RevisionHead, Files) {
        let Made { revision: new, log } = made;
        let (tiles, of_tiles) = split_keys(new.tiles);
        let (sums, of_sums) = split_keys(new.sums);
        let (names, of_levels): (Vec<_>, Files) = new
            .files
            .into_iter()
            .map(|(level, name, bytes)| ((level, name.to_owned()), Some(Bytes::from(bytes))))
            .unzip();
        let head = RevisionHead {
            manifest: new.manifest,
            tiles,
            sums,
            files: names,
            same_mesh_parts: new.same_mesh_parts,
            objects: new.objects,
            coverage: new.coverage,
            has_object_changes: new.has_object_changes,
            log,
        };
        (head, [of_tiles, of_sums, of_levels].concat())
    }

    /// Returns `None` if the files are not those of the message.
    pub fn join(self, files: Files) -> Option<Made> {
        let RevisionHead { manifest, tiles, sums, files: names, log, .. } = self;
        if files.len() != tiles.len() + sums.len() + names.len() {
            return None;
        }
        let mut files = files.into_iter().map(|file| file.map(Vec::from));
        let mut join = |keys: Vec<TileKey>| keys.into_iter().zip(files.by_ref()).collect();
        let (tiles, sums) = (join(tiles), join(sums));
        let file = |((level, name), bytes): ((LevelName, String), Option<Vec<u8>>)| {
            let name = map_file::PLANS.into_iter().chain([map_file::SCENE]).find(|known| *known == name)?;
            Some((level, name, bytes?))
        };
        let revision = NewRevision {
            manifest,
            tiles,
            sums,
            files: names.into_iter().zip(files).map(file).collect::<Option<_>>()?,
            same_mesh_parts: self.same_mesh_parts,
            objects: self.objects,
            coverage: self.coverage,
            has_object_changes: self.has_object_changes,
        };
        Some(Made { revision, log })
    }
}

fn split_keys(files: Vec<(TileKey, Option<Vec<u8>>)>) -> (Vec<TileKey>, Files) {
    files.into_iter().map(|(key, bytes)| (key, bytes.map(Bytes::from))).unzip()
}

impl AnswerHead {
    pub fn split(answer: Answer) -> (AnswerHead, Files) {
        match answer {
            Answer::Files(files) => (AnswerHead::Files, files),
            Answer::Levels(None) => (AnswerHead::Levels(None), Files::new()),
            Answer::Levels(Some(levels)) => {
                let split = |level: Level| ((level.file.level, level.last), Some(level.file.bytes));
                let (heads, files): (Vec<_>, Files) = levels.into_iter().map(split).unzip();
                (AnswerHead::Levels(Some(heads)), files)
            }
        }
    }

    /// Returns `None` if the files are not those of the message.
    pub fn join(self, files: Files) -> Option<Answer> {
        let heads = match self {
            AnswerHead::Files => return Some(Answer::Files(files)),
            AnswerHead::Levels(None) => return Some(Answer::Levels(None)),
            AnswerHead::Levels(Some(heads)) if heads.len() == files.len() => heads,
            AnswerHead::Levels(Some(_)) => return None,
        };
        let join = |((level, last), bytes): ((LevelName, Earlier), Option<Bytes>)| {
            Some(Level { file: LevelFile { level, bytes: bytes? }, last, is_same: false })
        };
        let levels = heads.into_iter().zip(files).map(join).collect::<Option<_>>()?;
        Some(Answer::Levels(Some(levels)))
    }
}

/// Writes a message: the length of its JSON, the number of its files and the length of each, one more than it is and 0 for an
/// absent file, as numbers of 64 bits in little-endian order; then the JSON and the files.
pub(super) fn write(out: &mut impl Write, message: &impl Serialize, files: &Files) -> io::Result<()> {
    let json = serde_json::to_vec(message)?;
    let lengths = files.iter().map(|file| file.as_ref().map_or(0, |bytes| bytes.len() as u64 + 1));
    let head = [json.len() as u64, files.len() as u64].into_iter().chain(lengths);
    out.write_all(&head.flat_map(u64::to_le_bytes).collect::<Vec<u8>>())?;
    out.write_all(&json)?;
    for bytes in files.iter().flatten() {
        out.write_all(bytes)?;
    }
    out.flush()
}

/// Reads a message of at most `max_bytes`. The error of one for which there is no memory is [`io::ErrorKind::OutOfMemory`].
pub(super) fn read<T: DeserializeOwned>(input: &mut impl Read, max_bytes: u64) -> io::Result<(T, Files)> {
    let mut left = max_bytes;
    let json_length = number(input)?;
    let count = number(input)?;
    if count > MAX_FILES {
        return Err(invalid("the message has too many files"));
    }
    let lengths: Vec<u64> = (0..count).map(|_| number(input)).collect::<io::Result<_>>()?;
    let message = serde_json::from_slice(&bytes(input, json_length, &mut left)?)?;
    let mut file =
        |length: u64| length.checked_sub(1).map(|length| bytes(input, length, &mut left)).transpose();
    let files = lengths.into_iter().map(|length| Ok(file(length)?.map(Bytes::from)));
    Ok((message, files.collect::<io::Result<_>>()?))
}

fn number(input: &mut impl Read) -> io::Result<u64> {
    let mut bytes = [0; 8];
    input.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

/// Reads so many bytes and takes them from those that are `left`.
fn bytes(input: &mut impl Read, length: u64, left: &mut u64) -> io::Result<Vec<u8>> {
    *left = left.checked_sub(length).ok_or_else(|| invalid("the message is too long"))?;
    let mut bytes = Vec::new();
    // A buffer that grows takes up to twice the memory.
    bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
    // A message may tell more than it has.
    if input.by_ref().take(length).read_to_end(&mut bytes)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(bytes)
}

fn invalid(cause: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, cause)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILE: TileKey = TileKey { level: LevelName::MAIN, x: -3, y: 7 };
    const MAX_BYTES: u64 = 1 << 20;

    fn made() -> Made {
        let revision = NewRevision {
            tiles: vec![(TILE, Some(b"points".to_vec())), (TileKey { x: 0, ..TILE }, None)],
            sums: vec![(TILE, None), (TILE, Some(Vec::new()))],
            files: vec![(LevelName::MAIN, map_file::SCENE, b"{}".to_vec())],
            same_mesh_parts: vec![LevelName::MAIN],
            coverage: vec![LevelCoverage { level: LevelName::MAIN, seen: 0.1 + 0.2, floor_seen: 1e-300 }],
            has_object_changes: true,
            ..NewRevision::default()
        };
        Made { revision, log: Log { windows: 3, network_failure: Some("why".to_owned()), ..Log::default() } }
    }

    fn message() -> Vec<u8> {
        let (head, files) = RevisionHead::split(made());
        let mut bytes = Vec::new();
        write(&mut bytes, &Told::Made(Some(Box::new(head))), &files).unwrap();
        bytes
    }

    #[test]
    fn a_revision_arrives_as_it_was() {
        let (told, files) = read(&mut message().as_slice(), MAX_BYTES).unwrap();
        let Told::Made(Some(head)) = told else { panic!("{told:?}") };
        assert_eq!(format!("{:?}", head.join(files).unwrap()), format!("{:?}", made()));
    }

    #[test]
    fn the_levels_arrive_as_they_were() {
        let last = Earlier { home_name: Some("Home".to_owned()), ..Earlier::default() };
        let file = LevelFile { level: LevelName::MAIN, bytes: Bytes::from_static(b"map") };
        let answer = Answer::Levels(Some(vec![Level { file, last, is_same: false }]));
        let (head, files) = AnswerHead::split(answer);
        let mut bytes = Vec::new();
        write(&mut bytes, &head, &files).unwrap();
        let (head, files) = read::<AnswerHead>(&mut bytes.as_slice(), MAX_BYTES).unwrap();
        let Some(Answer::Levels(Some(levels))) = head.join(files) else { panic!("no levels") };
        let level = &levels[0];
        assert_eq!((&level.file.bytes[..], level.last.home_name.as_deref()), (&b"map"[..], Some("Home")));
        assert!(AnswerHead::Levels(Some(Vec::new())).join(vec![None]).is_none());
    }

    #[test]
    fn a_message_without_memory_for_it_is_told_apart() {
        let head = [1 << 60, 0].map(u64::to_le_bytes).concat();
        let error = read::<Told>(&mut head.as_slice(), u64::MAX).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::OutOfMemory);
    }

    #[test]
    fn broken_messages_are_errors() {
        let whole = message();
        for length in 0..whole.len() {
            assert!(read::<Told>(&mut &whole[..length], MAX_BYTES).is_err(), "{length} bytes");
        }
        assert!(read::<Told>(&mut whole.as_slice(), 10).is_err(), "longer than allowed");
        for at in 0..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 0x80;
            // No length of a changed message makes it take the memory that it tells.
            if let Ok((Told::Made(Some(head)), files)) = read(&mut changed.as_slice(), MAX_BYTES) {
                let _ = head.join(files);
            }
        }
    }
}
