//! `viola clean`: removes what killed processes left behind. A server on SQLite does so when it starts; where many
//! processes share a store, one runs this from time to time.

use super::store::StoreArguments;
use super::worker::seconds;
use crate::storage::{Storage, SweepLimit};
use anyhow::Result;
use clap::Args;
use jiff::{SignedDuration, Timestamp};
use std::time::Duration;

#[derive(Args)]
pub struct CleanArguments {
    #[command(flatten)]
    store: StoreArguments,
    /// Leave what is younger: a job writes its files for so long before they are named.
    #[arg(long, value_name = "SECONDS", default_value = "86400", value_parser = seconds)]
    older_than_seconds: Duration,
    /// Remove files that no row names however many they are; by default nothing is removed if they are more than killed
    /// processes leave, since then the database may be the wrong one. Stop all servers before it.
    #[arg(long)]
    remove_unknown: bool,
}

pub fn run(arguments: &CleanArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let storage = Storage::administer(&arguments.store.params()).await?;
        let age = SignedDuration::try_from(arguments.older_than_seconds)?;
        let uploads = storage.expire_uploads(Timestamp::now()).await?;
        while storage.finish_deletions().await? > 0 {}
        let limit = if arguments.remove_unknown { SweepLimit::Everything } else { SweepLimit::Leftovers };
        let blobs = storage.sweep(Timestamp::now() - age, limit).await;
        storage.close().await;
        let blobs = blobs?;
        println!("removed {uploads} expired uploads and {blobs} blobs that nothing names");
        Ok(())
    })
}
