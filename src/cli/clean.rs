//! `viola clean`: removes expired uploads and the files that killed processes left behind. A server on SQLite
//! does so at its start; if many processes share a store, run this command periodically.

use super::args::{StoreArguments, seconds};
use anyhow::Result;
use clap::Args;
use jiff::{SignedDuration, Timestamp};
use std::time::Duration;
use uuid::Uuid;
use viola_storage::{Storage, SweepLimit};

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
    /// Id of the store, from the refusal to start: needed if the database names none of the store's files.
    #[arg(long, value_name = "ID", requires = "remove_unknown")]
    store_id: Option<Uuid>,
}

pub fn run(arguments: &CleanArguments) -> Result<()> {
    arguments.store.administer(async |storage| clean(storage, arguments).await)
}

async fn clean(storage: &Storage, arguments: &CleanArguments) -> Result<()> {
    if let Some(id) = arguments.store_id {
        storage.take_over_store(id).await?;
    }
    // A deletion from the wrong store would succeed, since files that are not there count as deleted.
    storage.check_store().await?;
    let age = SignedDuration::try_from(arguments.older_than_seconds).unwrap_or(SignedDuration::MAX);
    let uploads = storage.expire_uploads(storage.now()).await?;
    let deletions = storage.finish_deletions().await;
    let limit = if arguments.remove_unknown { SweepLimit::Everything } else { SweepLimit::Leftovers };
    // An age from before all times selects no file.
    let older_than = storage.now().checked_sub(age).unwrap_or(Timestamp::MIN);
    let blobs = storage.sweep(older_than, limit).await?;
    println!("removed {uploads} expired uploads and {blobs} blobs that nothing names");
    // A store that fails to remove some files must not keep the others from being removed.
    deletions?;
    Ok(())
}
