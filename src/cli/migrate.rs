//! `viola migrate`

use super::fail;
use crate::storage::Storage;
use std::path::PathBuf;
use std::process::ExitCode;

/// Bring the tables of a data folder up to date, without serving. `serve` does it too.
#[derive(clap::Args)]
pub(super) struct Migrate {
    /// The data folder.
    #[arg(long, value_name = "DIR", default_value = "viola-data")]
    data: PathBuf,
}

impl Migrate {
    pub fn run(&self) -> ExitCode {
        let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
            Ok(runtime) => runtime,
            Err(error) => return fail(&error),
        };
        let migrated = runtime.block_on(async {
            Storage::migrate(&self.data).await?.close().await;
            Ok::<(), crate::storage::StorageError>(())
        });
        match migrated {
            Ok(()) => {
                println!("{} is up to date", self.data.display());
                ExitCode::SUCCESS
            }
            Err(error) => fail(&error),
        }
    }
}
