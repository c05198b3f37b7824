//! Arguments for the storage of the service.

use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use viola_storage::{
    InvalidSecretsKey, POSTGRES_CONNECTIONS, PostgresParams, S3Params, SecretsKey, Storage, StorageError,
    StorageParams, UnpackParams,
};

#[derive(Args)]
pub struct StoreArguments {
    /// Data folder. It holds everything that is not in PostgreSQL or S3. `serve`, `work`, `migrate` and `keys create` make a
    /// missing one; the other commands refuse it.
    #[arg(long, value_name = "DIR", env = "VIOLA_DATA", default_value = "viola-data")]
    data: PathBuf,
    /// PostgreSQL database: postgres://USER:PASSWORD@HOST/DATABASE. Many processes may share it. Default:
    /// SQLite in the data folder.
    #[arg(long, value_name = "URL", env = "VIOLA_DATABASE_URL", hide_env_values = true)]
    database_url: Option<String>,
    /// Maximum number of connections of this process to PostgreSQL.
    #[arg(long, value_name = "N", env = "VIOLA_DATABASE_CONNECTIONS", default_value_t = POSTGRES_CONNECTIONS)]
    database_connections: u32,
    /// File with the key that seals the secrets of webhooks in the database: 32 random bytes in base64. Give it to all
    /// processes. Default: secrets in plain text.
    #[arg(long = "secrets-key-file", value_name = "FILE", env = "VIOLA_SECRETS_KEY_FILE", value_parser = secrets_key)]
    secrets_key: Option<SecretsKey>,
    /// Bucket of S3 or of a compatible store. Default: files in the data folder.
    #[arg(long, value_name = "NAME", env = "VIOLA_S3_BUCKET",
        requires_all = ["s3_access_key_id", "s3_secret_access_key"])]
    s3_bucket: Option<String>,
    /// Prefix of the names of all objects; objects with this prefix must belong to this service only.
    #[arg(long, value_name = "PREFIX", env = "VIOLA_S3_PREFIX", default_value = "")]
    s3_prefix: String,
    /// URL of the store; default: Amazon's.
    // Without the bucket's name, files would go to the data folder without a word.
    #[arg(long, value_name = "URL", env = "VIOLA_S3_ENDPOINT", requires = "s3_bucket")]
    s3_endpoint: Option<String>,
    /// Region of the bucket.
    #[arg(long, value_name = "NAME", env = "VIOLA_S3_REGION", default_value = "us-east-1")]
    s3_region: String,
    /// Id of the key for the bucket.
    #[arg(
        long,
        value_name = "ID",
        env = "VIOLA_S3_ACCESS_KEY_ID",
        hide_env_values = true,
        requires = "s3_bucket"
    )]
    s3_access_key_id: Option<String>,
    /// Secret of the key for the bucket.
    #[arg(long, value_name = "SECRET", env = "VIOLA_S3_SECRET_ACCESS_KEY", hide_env_values = true)]
    s3_secret_access_key: Option<String>,
    /// Allow an endpoint with http, which is not encrypted.
    #[arg(long, env = "VIOLA_S3_ALLOW_HTTP")]
    s3_allow_http: bool,
    /// Put the bucket's name into the host name, as Amazon does, instead of the path.
    #[arg(long, env = "VIOLA_S3_VIRTUAL_HOSTED")]
    s3_virtual_hosted: bool,
}

impl StoreArguments {
    pub fn params(&self) -> StorageParams {
        StorageParams {
            data: self.data.clone(),
            postgres: self
                .database_url
                .clone()
                .map(|url| PostgresParams { url, connections: self.database_connections }),
            s3: self.s3(),
            secrets_key: self.secrets_key.clone(),
            unpack: UnpackParams::default(),
        }
    }

    /// Runs `work` on the storage of a service that is there, beside its servers.
    pub fn administer<T>(&self, work: impl AsyncFnOnce(&Storage) -> Result<T>) -> Result<T> {
        run_on(Storage::administer(&self.params()), work)
    }

    /// Runs `work` as [`StoreArguments::administer`] does, and creates missing parts before.
    pub fn administer_or_create<T>(&self, work: impl AsyncFnOnce(&Storage) -> Result<T>) -> Result<T> {
        run_on(Storage::administer_or_create(&self.params()), work)
    }

    /// Creates or updates the tables, and runs `work`.
    pub fn migrate<T>(&self, work: impl AsyncFnOnce(&Storage) -> Result<T>) -> Result<T> {
        run_on(Storage::migrate(&self.params()), work)
    }

    fn s3(&self) -> Option<S3Params> {
        Some(S3Params {
            bucket: self.s3_bucket.clone()?,
            prefix: self.s3_prefix.clone(),
            endpoint: self.s3_endpoint.clone(),
            region: self.s3_region.clone(),
            access_key_id: self.s3_access_key_id.clone().unwrap_or_default(),
            secret_access_key: self.s3_secret_access_key.clone().unwrap_or_default(),
            allow_http: self.s3_allow_http,
            path_style: !self.s3_virtual_hosted,
        })
    }
}

/// Runs `work` on the storage that `opened` returns, and closes it also after an error.
fn run_on<T>(
    opened: impl Future<Output = Result<Storage, StorageError>>,
    work: impl AsyncFnOnce(&Storage) -> Result<T>,
) -> Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let storage = opened.await?;
        let done = work(&storage).await;
        storage.close().await;
        done
    })
}

fn secrets_key(file: &str) -> Result<SecretsKey, String> {
    let text = std::fs::read_to_string(file).map_err(|error| error.to_string())?;
    text.parse().map_err(|error: InvalidSecretsKey| error.to_string())
}
