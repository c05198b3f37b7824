//! Assembles a map on a thread of its own, which asks for the clips it needs.
//!
//! The thread waits for clips, and tokio's pool of blocking threads reads clips in a local folder. A thread
//! of that pool must therefore not wait for a clip: if all of them wait, none is left to read. A worker has
//! one such thread at a time.

use super::running::Running;
use super::{FILES_AT_A_TIME, MergeError, on_own_thread};
use bytes::Bytes;
use futures::stream::{self, StreamExt, TryStreamExt};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use tokio::sync::mpsc;
use tracing::warn;
use viola_home as home;
use viola_home::{Assembly, ClipContribution, LoadClips, Manifest, Member, TileKey, read_features};
use viola_reconstruct::Feature;
use viola_storage::{MapFile, MergeClaim, Storage, StorageError, result_file};

/// The files that the thread needs.
enum Ask {
    /// Files of each clip, by their names.
    OfClips(Vec<Member>, &'static [&'static str]),
    /// The sums of tiles.
    Sums(Vec<TileKey>),
}

/// The files in the order in which they were asked for, clip by clip; `None` for a file that does not exist.
type Files = Vec<Option<Bytes>>;

/// Loads the files of clips for the thread.
struct Loader {
    asked: mpsc::UnboundedSender<Ask>,
    answers: std::sync::mpsc::Receiver<Result<Files, MergeError>>,
}

impl Loader {
    fn files(&self, members: &[&Member], names: &'static [&'static str]) -> Result<Files, MergeError> {
        self.answer(Ask::OfClips(members.iter().map(|member| (*member).clone()).collect(), names))
    }

    fn answer(&self, ask: Ask) -> Result<Files, MergeError> {
        self.asked.send(ask).map_err(|_| MergeError::Abandoned)?;
        self.answers.recv().map_err(|_| MergeError::Abandoned)?
    }
}

impl LoadClips<MergeError> for Loader {
    fn contributions(&mut self, members: &[&Member]) -> Result<Vec<ClipContribution>, MergeError> {
        let names = &[result_file::CLOUD, result_file::VIEWS];
        let files = self.files(members, names)?;
        let read = |(member, files): (&&Member, &[Option<Bytes>])| {
            let [Some(cloud), Some(views)] = files else { return Err(damaged(member)) };
            ClipContribution::read(cloud, views).map_err(|_| damaged(member))
        };
        members.par_iter().zip(files.par_chunks(names.len())).map(read).collect()
    }

    fn features(&mut self, members: &[&Member]) -> Result<Vec<Vec<Feature>>, MergeError> {
        let files = self.files(members, &[result_file::FEATURES])?;
        Ok(members.par_iter().zip(files).map(|(member, file)| features(member, file)).collect())
    }

    fn sums(&mut self, tiles: &[TileKey]) -> Result<Vec<Option<Vec<u8>>>, MergeError> {
        let sums = self.answer(Ask::Sums(tiles.to_vec()))?;
        Ok(sums.into_iter().map(|sums| sums.map(|sums| sums.to_vec())).collect())
    }
}

/// Assembles the map of the claim's clips from the last one. The thread ends soon after the merge was asked to stop.
pub(super) async fn assemble(
    storage: &Storage,
    claim: &MergeClaim,
    last: &Manifest,
    running: Arc<Running>,
) -> Result<Assembly, MergeError> {
    let mut sums: BTreeMap<TileKey, MapFile> = BTreeMap::new();
    // A map that is made again from its clips does not take the sums of a damaged one.
    if *last != Manifest::default() {
        for file in storage.last_sums(claim).await? {
            sums.extend(file.tile.map(|tile| (tile, file)));
        }
    }
    let (asked, mut asks) = mpsc::unbounded_channel();
    let (answer, answers) = std::sync::mpsc::channel();
    let (last, members) = (last.clone(), claim.members.clone());
    let work = move || home::assemble(&last, members, &mut Loader { asked, answers }, &*running);
    let end = on_own_thread(work)?;
    // Ends when the thread does.
    while let Some(ask) = asks.recv().await {
        let files = match ask {
            Ask::OfClips(members, names) => files(storage, &members, names).await,
            Ask::Sums(tiles) => {
                let read = |tile: TileKey| {
                    let file = sums.get(&tile);
                    async move {
                        match file {
                            Some(file) => storage.map_file_bytes(file).await,
                            None => Ok(None),
                        }
                    }
                };
                let reads: Vec<_> = tiles.into_iter().map(read).collect();
                stream::iter(reads).buffered(FILES_AT_A_TIME).try_collect().await
            }
        };
        // The thread waits for each answer, unless it has ended.
        let _ = answer.send(files.map_err(MergeError::from));
    }
    end.await.unwrap_or(Err(MergeError::Panicked))
}

/// Returns a clip's features. A clip whose file is missing or damaged has none: its cloud belongs in the map without matches.
fn features(member: &Member, file: Option<Bytes>) -> Vec<Feature> {
    let read = file.map(|bytes| read_features(&bytes)).transpose();
    if read.is_err() {
        warn!(clip = %member.clip, "the features of a clip are damaged; it is merged without matches");
    }
    read.ok().flatten().unwrap_or_default()
}

/// The error of a clip with a missing or damaged file. If the clip was removed or aligned again meanwhile, the home is due
/// again.
fn damaged(member: &Member) -> MergeError {
    MergeError::DamagedClip { clip: member.clip }
}

async fn files(storage: &Storage, members: &[Member], names: &[&str]) -> Result<Files, StorageError> {
    let all = members.iter().flat_map(|member| names.iter().map(move |name| (member, *name)));
    let reads: Vec<_> = all.map(|(member, name)| storage.member_file(member, name)).collect();
    stream::iter(reads).buffered(FILES_AT_A_TIME).try_collect().await
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;
    use viola_home::{Verdict, features_bytes};
    use viola_reconstruct::{DESCRIPTOR_BYTES, Descriptor};

    #[test]
    fn a_clip_with_damaged_features_has_none() {
        let member = Member {
            clip: Uuid::nil(),
            recorded_at_ms: None,
            sha256: String::new(),
            contribution: String::new(),
            verdict: Verdict::Unplaced,
        };
        let feature =
            Feature { position_m: [1.0; 3], heading_rad: 0.5, descriptor: Descriptor([7; DESCRIPTOR_BYTES]) };
        let whole = Bytes::from(features_bytes(&[feature]));
        let cut = whole.slice(..whole.len() / 2);
        assert_eq!(features(&member, Some(whole)), [feature]);
        for file in [None, Some(cut), Some(Bytes::from_static(b"damaged"))] {
            assert!(features(&member, file).is_empty());
        }
    }
}
