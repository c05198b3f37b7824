//! Assembles a map on a thread of its own, which asks for the clips it needs.
//!
//! The thread waits for clips, and tokio's pool of blocking threads reads clips in a local folder. A thread
//! of that pool must therefore not wait for a clip: if all of them wait, none is left to read. A worker has
//! one such thread at a time; if the worker gives up the merge, the thread ends at its next request.

use super::{MergeError, on_own_thread};
use crate::storage::{MapFile, MergeClaim, Storage, StorageError, result_file};
use bytes::Bytes;
use std::collections::BTreeMap;
use tokio::sync::mpsc;
use viola_home as home;
use viola_home::{Assembly, ClipContribution, LoadClips, Manifest, Member, TileKey, read_features};
use viola_reconstruct::Feature;

/// The files that the thread needs.
enum Ask {
    /// Files of a clip, by their names.
    OfClip(Member, &'static [&'static str]),
    /// The sums of a tile.
    Sums(TileKey),
}

/// The files, in the order of the names; `None` for a file that does not exist.
type Files = Vec<Option<Bytes>>;

/// Loads the files of clips for the thread.
struct Loader {
    asked: mpsc::UnboundedSender<Ask>,
    answers: std::sync::mpsc::Receiver<Result<Files, MergeError>>,
}

impl Loader {
    fn files(&self, member: &Member, names: &'static [&'static str]) -> Result<Files, MergeError> {
        self.answer(Ask::OfClip(member.clone(), names))
    }

    fn answer(&self, ask: Ask) -> Result<Files, MergeError> {
        self.asked.send(ask).map_err(|_| MergeError::Abandoned)?;
        self.answers.recv().map_err(|_| MergeError::Abandoned)?
    }
}

impl LoadClips<MergeError> for Loader {
    fn contribution(&mut self, member: &Member) -> Result<ClipContribution, MergeError> {
        let files = self.files(member, &[result_file::CLOUD, result_file::VIEWS])?;
        let [Some(cloud), Some(views)] = files.as_slice() else { return Err(MergeError::Gone) };
        Ok(ClipContribution::read(cloud, views)?)
    }

    fn features(&mut self, member: &Member) -> Result<Vec<Feature>, MergeError> {
        let files = self.files(member, &[result_file::FEATURES])?;
        let [Some(features)] = files.as_slice() else { return Ok(Vec::new()) };
        Ok(read_features(features)?)
    }

    fn sums(&mut self, tile: &TileKey) -> Result<Option<Vec<u8>>, MergeError> {
        let sums = self.answer(Ask::Sums(*tile))?.into_iter().flatten().next();
        Ok(sums.map(|sums| sums.to_vec()))
    }
}

/// Assembles the map of the claim's clips from the last one.
pub(super) async fn assemble(
    storage: &Storage,
    claim: &MergeClaim,
    last: &Manifest,
) -> Result<Assembly, MergeError> {
    let mut sums: BTreeMap<TileKey, MapFile> = BTreeMap::new();
    for file in storage.last_sums(claim).await? {
        sums.extend(file.tile.map(|tile| (tile, file)));
    }
    let (asked, mut asks) = mpsc::unbounded_channel();
    let (answer, answers) = std::sync::mpsc::channel();
    let (last, members) = (last.clone(), claim.members.clone());
    let end = on_own_thread(move || home::assemble(&last, members, &mut Loader { asked, answers }))?;
    // Ends when the thread does.
    while let Some(ask) = asks.recv().await {
        let files = match ask {
            Ask::OfClip(member, names) => files(storage, &member, names).await,
            Ask::Sums(tile) => match sums.get(&tile) {
                Some(file) => storage.map_file_bytes(file).await.map(|sums| vec![sums]),
                None => Ok(Files::new()),
            },
        };
        // The thread waits for each answer, unless it has ended.
        let _ = answer.send(files.map_err(MergeError::from));
    }
    end.await.unwrap_or(Err(MergeError::Panicked))
}

async fn files(storage: &Storage, member: &Member, names: &[&str]) -> Result<Files, StorageError> {
    let mut files = Files::new();
    for name in names {
        files.push(storage.member_file(member, name).await?);
    }
    Ok(files)
}
