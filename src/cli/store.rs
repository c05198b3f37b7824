//! Where the service keeps what it keeps, as the command line says it.

use crate::storage::{POSTGRES_CONNECTIONS, PostgresParams, StorageParams};
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct StoreArguments {
    /// The data folder; it is made when it is not there. Everything lies in it, unless another place is named.
    #[arg(long, value_name = "DIR", env = "VIOLA_DATA", default_value = "viola-data")]
    data: PathBuf,
    /// A PostgreSQL database in place of SQLite in the data folder: postgres://USER:PASSWORD@HOST/DATABASE. Many
    /// processes may share it.
    #[arg(long, value_name = "URL", env = "VIOLA_DATABASE_URL", hide_env_values = true)]
    database_url: Option<String>,
    /// Connections of this process to PostgreSQL, at most.
    #[arg(long, value_name = "N", env = "VIOLA_DATABASE_CONNECTIONS", default_value_t = POSTGRES_CONNECTIONS)]
    database_connections: u32,
}

impl StoreArguments {
    pub fn params(&self) -> StorageParams {
        StorageParams {
            data: self.data.clone(),
            postgres: self
                .database_url
                .clone()
                .map(|url| PostgresParams { url, connections: self.database_connections }),
        }
    }
}
