//! `viola migrate`: creates or updates the database tables without serving.

use super::args::StoreArguments;
use anyhow::Result;
use clap::Args;

#[derive(Args)]
pub struct MigrateArguments {
    #[command(flatten)]
    store: StoreArguments,
}

pub fn run(arguments: &MigrateArguments) -> Result<()> {
    let database = arguments.store.migrate(async |storage| Ok(storage.database_name()))?;
    println!("the tables of {database} are up to date");
    Ok(())
}
