//! The work of a merge: assembles the next map, labels it and describes it. It knows no storage and asks for the files that it
//! needs, so it runs on a thread or in a process of its own.
//!
//! The work waits for files, and tokio's pool of blocking threads reads files in a local folder. A thread of that pool must
//! therefore not do the work: if all of them wait, none is left to read. A worker has one merge at a time.

use super::error::MergeError;
use super::revision::{Level, label, revision};
use bytes::Bytes;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;
use uuid::Uuid;
use viola_geometry::progress::Progress;
use viola_home as home;
use viola_home::{Assembly, ClipContribution, LoadClips, Manifest, Member, TileKey, read_features};
use viola_reconstruct::Feature;
use viola_reconstruct::label::SurfaceNetwork;
use viola_storage::NewRevision;

/// Files in the order in which they were asked for; `None` for a file that does not exist.
pub(super) type Files = Vec<Option<Bytes>>;

/// The begin of the work.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Order {
    pub last: Manifest,
    pub members: Vec<Member>,
}

/// A question of the work to its worker.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Request {
    /// The cloud and the views of each clip.
    Contributions(Vec<Uuid>),
    /// The features of each clip.
    Features(Vec<Uuid>),
    /// The sums of tiles.
    Sums(Vec<TileKey>),
    /// The levels of the next revision, whose manifest this is but for its labels.
    Levels(Manifest),
    /// Tiles of the last map.
    Tiles(Vec<TileKey>),
}

/// The worker's answer to a [`Request`].
pub(super) enum Answer {
    Files(Files),
    /// The levels with a LiDAR map; `None` if the map stays as it was.
    Levels(Option<Vec<Level>>),
}

/// A new revision, and what the worker logs.
#[derive(Debug, Clone)]
pub(super) struct Made {
    pub revision: NewRevision,
    pub log: Log,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Log {
    /// Windows that were labelled.
    pub windows: usize,
    /// Reason why the surface network was not used for all of them.
    pub network_failure: Option<String>,
    /// Clips whose features are damaged: they are merged without matches.
    pub without_features: Vec<Uuid>,
}

/// The way from the work to its worker.
pub(super) trait Link {
    fn ask(&mut self, request: Request) -> Result<Answer, MergeError>;
}

/// The link of a thread. An error means that nobody waits for the work any more.
pub(super) struct ThreadLink {
    asked: mpsc::UnboundedSender<Request>,
    answers: std::sync::mpsc::Receiver<Answer>,
}

/// The worker's end of a [`ThreadLink`].
pub(super) struct WorkerEnd {
    /// It closes when the work has ended.
    pub requests: mpsc::UnboundedReceiver<Request>,
    pub answers: std::sync::mpsc::Sender<Answer>,
}

impl ThreadLink {
    pub fn new() -> (ThreadLink, WorkerEnd) {
        let (asked, requests) = mpsc::unbounded_channel();
        let (answers, answered) = std::sync::mpsc::channel();
        (ThreadLink { asked, answers: answered }, WorkerEnd { requests, answers })
    }
}

impl Link for ThreadLink {
    fn ask(&mut self, request: Request) -> Result<Answer, MergeError> {
        self.asked.send(request).map_err(|_| MergeError::Abandoned)?;
        self.answers.recv().map_err(|_| MergeError::Abandoned)
    }
}

/// Returns the next revision, `None` if the map stays as it was. Ends soon after `progress` is cancelled.
pub(super) fn make(
    order: Order,
    link: &mut dyn Link,
    surface: Option<&SurfaceNetwork>,
    progress: &dyn Progress,
) -> Result<Option<Made>, MergeError> {
    let Order { last, members } = order;
    let mut loader = Loader { link, log: Log::default() };
    let assembly = home::assemble(&last, members, &mut loader, progress)?;
    let Some(mut levels) = loader.levels(&assembly)? else { return Ok(None) };
    let is_labelled = assembly.is_labelled_by(surface);
    for level in &mut levels {
        level.is_same = is_labelled && level.last.is_described() && !assembly.touches(level.file.level);
    }
    let stays = |key: &TileKey| levels.iter().any(|level| level.is_same && level.file.level == key.level);
    let kept: Vec<TileKey> = assembly.kept().filter(|key| !stays(key)).copied().collect();
    let files = loader.tiles(&kept)?;
    let map = label(assembly, kept.into_iter().zip(files).collect(), surface, progress)?;
    let log = Log {
        windows: map.windows,
        network_failure: map.failure.as_ref().map(ToString::to_string),
        ..loader.log
    };
    Ok(Some(Made { revision: revision(map, &levels, progress)?, log }))
}

/// Asks for files and reads them.
struct Loader<'a> {
    link: &'a mut dyn Link,
    log: Log,
}

impl Loader<'_> {
    /// Returns `count` files.
    fn files(&mut self, request: Request, count: usize) -> Result<Files, MergeError> {
        match self.link.ask(request)? {
            Answer::Files(files) if files.len() == count => Ok(files),
            _ => Err(MergeError::Abandoned),
        }
    }

    fn levels(&mut self, assembly: &Assembly) -> Result<Option<Vec<Level>>, MergeError> {
        match self.link.ask(Request::Levels(assembly.manifest.clone()))? {
            Answer::Levels(levels) => Ok(levels),
            Answer::Files(_) => Err(MergeError::Abandoned),
        }
    }

    fn tiles(&mut self, tiles: &[TileKey]) -> Result<Vec<Bytes>, MergeError> {
        let files = self.files(Request::Tiles(tiles.to_vec()), tiles.len())?;
        files.into_iter().map(|file| file.ok_or(MergeError::DamagedMap)).collect()
    }
}

impl LoadClips<MergeError> for Loader<'_> {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, MergeError> {
        let files = self.files(Request::Contributions(ids(members)), 2 * members.len())?;
        let read = |(member, files): (&&Member, &[Option<Bytes>])| {
            let [Some(cloud), Some(views)] = files else { return Err(damaged(member)) };
            ClipContribution::read(cloud, views).map_err(|_| damaged(member))
        };
        members.par_iter().zip(files.par_chunks(2)).map(read).collect()
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, MergeError> {
        let files = self.files(Request::Features(ids(members)), members.len())?;
        let read: Vec<Option<Vec<Feature>>> = files.par_iter().map(|file| features(file.as_ref())).collect();
        let damaged = members.iter().zip(&read).filter(|(_, features)| features.is_none());
        self.log.without_features.extend(damaged.map(|(member, _)| member.clip));
        Ok(read.into_iter().map(Option::unwrap_or_default).collect())
    }

    fn sums(&mut self, tiles: &[TileKey]) -> Result<Vec<Option<Vec<u8>>>, MergeError> {
        let sums = self.files(Request::Sums(tiles.to_vec()), tiles.len())?;
        Ok(sums.into_iter().map(|sums| sums.map(Vec::from)).collect())
    }
}

fn ids(members: &[&Member]) -> Vec<Uuid> {
    members.iter().map(|member| member.clip).collect()
}

/// Returns a clip's features, `None` if the file is damaged: its cloud belongs in the map without matches. A clip that was
/// aligned before features were stored has none.
fn features(file: Option<&Bytes>) -> Option<Vec<Feature>> {
    file.map_or(Some(Vec::new()), |bytes| read_features(bytes).ok())
}

/// The error of a clip with a missing or damaged file. If the clip was removed or aligned again meanwhile, the home is due
/// again.
fn damaged(member: &Member) -> MergeError {
    MergeError::DamagedClip { clip: member.clip }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_home::features_bytes;
    use viola_reconstruct::{DESCRIPTOR_BYTES, Descriptor};

    #[test]
    fn damaged_features_are_told() {
        let feature =
            Feature { position_m: [1.0; 3], heading_rad: 0.5, descriptor: Descriptor([7; DESCRIPTOR_BYTES]) };
        let whole = Bytes::from(features_bytes(&[feature]));
        let cut = whole.slice(..whole.len() / 2);
        assert_eq!(features(Some(&whole)), Some(vec![feature]));
        assert_eq!(features(None), Some(Vec::new()));
        for file in [cut, Bytes::from_static(b"damaged")] {
            assert!(features(Some(&file)).is_none());
        }
    }
}
