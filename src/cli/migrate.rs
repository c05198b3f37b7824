//! `viola migrate`: creates or updates the database tables without serving.

use super::args::StoreArguments;
use anyhow::Result;
use clap::Args;
use viola_storage::Storage;

#[derive(Args)]
pub struct MigrateArguments {
    #[command(flatten)]
    store: StoreArguments,
}

pub fn run(arguments: &MigrateArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let storage = Storage::migrate(&arguments.store.params()).await?;
        println!("the tables of {} are up to date", storage.database_name());
        storage.close().await;
        anyhow::Ok(())
    })
}
