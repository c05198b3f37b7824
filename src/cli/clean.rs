//! `viola clean`: removes expired uploads and the files that killed processes left behind. A server on SQLite
//! does so at its start; if many processes share a store, run this command periodically.

use super::args::{StoreArguments, seconds};
use crate::storage::{Storage, SweepLimit};
use anyhow::Result;
use clap::Args;
use jiff::{SignedDuration, Timestamp};
use std::time::Duration;

#[derive(Args)]
pub struct CleanArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Minimum age of the files to remove, in seconds: a job writes its files before the database names them.
    #[arg(long, value_name = "SECONDS", default_value = "86400", value_parser = seconds)]
    older_than_seconds: Duration,
    /// Remove all files that the database does not name. By default, nothing is removed if there are more of
    /// them than killed processes leave, because the database may be the wrong one. Stop all servers first.
    #[arg(long)]
    remove_unknown: bool,
}

pub fn run(arguments: &CleanArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let storage = Storage::administer(&arguments.store.params()).await?;
        let age = SignedDuration::try_from(arguments.older_than_seconds)?;
        let uploads = storage.expire_uploads(Timestamp::now()).await?;
        let deletions = storage.finish_deletions().await;
        let limit = if arguments.remove_unknown { SweepLimit::Everything } else { SweepLimit::Leftovers };
        let blobs = storage.sweep(Timestamp::now() - age, limit).await;
        storage.close().await;
        let blobs = blobs?;
        println!("removed {uploads} expired uploads and {blobs} blobs that nothing names");
        // A store that fails to remove some files must not keep the others from being removed.
        deletions?;
        Ok(())
    })
}
