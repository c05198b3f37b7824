//! Assembles a map on a thread of its own, which asks for the clips it needs.
//!
//! The thread waits for clips, and tokio's pool of blocking threads reads clips in a local folder. A thread
//! of that pool must therefore not wait for a clip: if all of them wait, none is left to read. A worker has
//! one such thread at a time; if the worker gives up the merge, the thread ends at its next request.

use super::MergeError;
use crate::storage::{Storage, result_file};
use bytes::Bytes;
use std::thread;
use tokio::sync::{mpsc, oneshot};
use tracing::Span;
use viola_home as home;
use viola_home::{Assembly, ClipContribution, LoadClips, Manifest, Member, read_features};
use viola_reconstruct::Feature;

/// A clip, and the names of its files that the thread needs.
type Ask = (Member, &'static [&'static str]);

/// The files, in the order of the names; `None` for a file that the result lacks.
type Files = Vec<Option<Bytes>>;

/// Loads the files of clips for the thread.
struct Loader {
    asked: mpsc::UnboundedSender<Ask>,
    answers: std::sync::mpsc::Receiver<Result<Files, MergeError>>,
}

impl Loader {
    fn files(&self, member: &Member, names: &'static [&'static str]) -> Result<Files, MergeError> {
        self.asked.send((member.clone(), names)).map_err(|_| MergeError::Abandoned)?;
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
}

/// Assembles the map of `members` from the last one.
pub(super) async fn assemble(
    storage: &Storage,
    last: &Manifest,
    members: &[Member],
) -> Result<Assembly, MergeError> {
    let (asked, mut asks) = mpsc::unbounded_channel();
    let (answer, answers) = std::sync::mpsc::channel();
    let (ended, end) = oneshot::channel();
    let (last, members, span) = (last.clone(), members.to_vec(), Span::current());
    let work = move || {
        let _entered = span.entered();
        let mut loader = Loader { asked, answers };
        let assembled = home::assemble(&last, members, &mut loader);
        // The worker may have given up the merge.
        let _ = ended.send(assembled);
    };
    thread::Builder::new().name("merge".to_owned()).spawn(work).map_err(MergeError::NoThread)?;
    // Ends when the thread does.
    while let Some((member, names)) = asks.recv().await {
        // The thread waits for each answer, unless it has ended.
        let _ = answer.send(files(storage, &member, names).await);
    }
    end.await.unwrap_or(Err(MergeError::Panicked))
}

async fn files(storage: &Storage, member: &Member, names: &[&str]) -> Result<Files, MergeError> {
    let mut files = Files::new();
    for name in names {
        files.push(storage.member_file(member, name).await?);
    }
    Ok(files)
}
