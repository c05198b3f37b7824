//! `viola migrate`: the tables of a data folder, brought up to date without serving.

use crate::storage::Storage;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct MigrateArguments {
    /// The data folder.
    #[arg(long, value_name = "DIR", default_value = "viola-data")]
    data: PathBuf,
}

pub fn run(arguments: &MigrateArguments) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        Storage::migrate(&arguments.data).await?.close().await;
        anyhow::Ok(())
    })?;
    println!("{} is up to date", arguments.data.display());
    Ok(())
}
