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
use viola_home::{Assembly, ClipContribution, Manifest, Member};

/// The files of a clip that a merge reads.
struct Files {
    cloud: Bytes,
    views: Bytes,
}

/// Loads the files of clips for the thread.
struct Loader {
    asked: mpsc::UnboundedSender<Member>,
    answers: std::sync::mpsc::Receiver<Result<Files, MergeError>>,
}

impl Loader {
    fn load(&self, member: &Member) -> Result<ClipContribution, MergeError> {
        self.asked.send(member.clone()).map_err(|_| MergeError::Abandoned)?;
        let Files { cloud, views } = self.answers.recv().map_err(|_| MergeError::Abandoned)??;
        Ok(ClipContribution::read(&cloud, &views)?)
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
        let loader = Loader { asked, answers };
        let mut load = |member: &Member| loader.load(member);
        let assembled = home::assemble(&last, members, &mut load);
        // The worker may have given up the merge.
        let _ = ended.send(assembled);
    };
    thread::Builder::new().name("merge".to_owned()).spawn(work).map_err(MergeError::NoThread)?;
    // Ends when the thread does.
    while let Some(member) = asks.recv().await {
        // The thread waits for each answer, unless it has ended.
        let _ = answer.send(files(storage, &member).await);
    }
    end.await.unwrap_or(Err(MergeError::Panicked))
}

async fn files(storage: &Storage, member: &Member) -> Result<Files, MergeError> {
    let cloud = storage.member_file(member, result_file::CLOUD).await?.ok_or(MergeError::Gone)?;
    let views = storage.member_file(member, result_file::VIEWS).await?.ok_or(MergeError::Gone)?;
    Ok(Files { cloud, views })
}
