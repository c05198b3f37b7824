//! API keys of tenants. A key is shown once, when it is created; only its SHA-256 is stored.

mod uses;

pub(super) use uses::KeyUses;

use super::database::{Row, query};
use super::{HomeId, Storage, StorageError, Tenant};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;
use std::str::FromStr;
use uuid::Uuid;

/// Prefix of a secret, so that a leaked one is recognised.
const PREFIX: &str = "viola_";
const SECRET_BYTES: usize = 32;

/// Resolution of the last use of a key.
const LAST_USE: SignedDuration = SignedDuration::from_secs(60);

/// Permissions of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Upload clips and follow their progress: for an app on a phone.
    Uploader,
    /// Read everything, change nothing.
    Reader,
    /// Everything.
    Admin,
}

impl Role {
    pub fn name(self) -> &'static str {
        match self {
            Role::Uploader => "uploader",
            Role::Reader => "reader",
            Role::Admin => "admin",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a role is one of uploader, reader and admin")]
pub struct InvalidRole;

impl FromStr for Role {
    type Err = InvalidRole;

    fn from_str(text: &str) -> Result<Role, InvalidRole> {
        let all = [Role::Uploader, Role::Reader, Role::Admin];
        all.into_iter().find(|role| role.name() == text).ok_or(InvalidRole)
    }
}

/// A key, without its secret.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ApiKey {
    pub id: Uuid,
    pub tenant: Tenant,
    pub role: Role,
    /// The only home that the key is for; `None` for all homes of the tenant.
    pub home: Option<HomeId>,
    /// Description for people.
    pub label: String,
    pub created_at: Timestamp,
    pub expires_at: Option<Timestamp>,
    pub revoked_at: Option<Timestamp>,
    /// Accurate to a minute.
    pub last_used_at: Option<Timestamp>,
}

impl ApiKey {
    pub fn is_valid(&self, now: Timestamp) -> bool {
        self.revoked_at.is_none() && self.expires_at.is_none_or(|end| now < end)
    }
}

/// A key to create.
#[derive(Debug, Clone)]
pub struct NewKey {
    pub tenant: Tenant,
    pub role: Role,
    pub home: Option<HomeId>,
    pub label: String,
    pub expires_at: Option<Timestamp>,
}

/// Secret of a key, which a caller presents. It is never logged.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Secret")
    }
}

impl FromStr for Secret {
    type Err = ();

    fn from_str(text: &str) -> Result<Secret, ()> {
        let digits = text.strip_prefix(PREFIX).ok_or(())?;
        let is_good = digits.len() == 2 * SECRET_BYTES && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
        if is_good { Ok(Secret(text.to_owned())) } else { Err(()) }
    }
}

impl Secret {
    fn new() -> Result<Secret, StorageError> {
        Ok(Secret(format!("{PREFIX}{}", random_hexadecimal::<SECRET_BYTES>()?)))
    }

    /// Returns the secret in plain text, to be shown to its owner.
    pub fn show(&self) -> &str {
        &self.0
    }

    /// Returns the SHA-256 by which the service knows the secret.
    pub fn sha256(&self) -> String {
        sha256(&self.0)
    }
}

pub(super) fn random_hexadecimal<const BYTES: usize>() -> Result<String, StorageError> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(|error| StorageError::Randomness(error.to_string()))?;
    Ok(hexadecimal(&bytes))
}

/// Returns the SHA-256 of a text in hexadecimal.
pub(super) fn sha256(text: &str) -> String {
    hexadecimal(&Sha256::digest(text.as_bytes()))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(super) fn from_row(row: &Row) -> Result<ApiKey, StorageError> {
    Ok(ApiKey {
        id: row.id("id")?,
        tenant: row.tenant("tenant")?,
        role: row.name("role")?,
        home: row.maybe_home("home_id")?,
        label: row.text("label")?,
        created_at: row.time("created_at")?,
        expires_at: row.maybe_time("expires_at")?,
        revoked_at: row.maybe_time("revoked_at")?,
        last_used_at: row.maybe_time("last_used_at")?,
    })
}

impl Storage {
    /// Creates a key; only this call returns the secret.
    pub async fn create_key(&self, new: NewKey, now: Timestamp) -> Result<(ApiKey, Secret), StorageError> {
        let (id, secret) = (Uuid::now_v7(), Secret::new()?);
        let mut transaction = self.database.begin().await?;
        query(
            "INSERT INTO api_keys (id, tenant, role, home_id, label, sha256, created_at, expires_at)
            VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
        )
        .bind(id.to_string())
        .bind(new.tenant.name())
        .bind(new.role.name())
        .bind(new.home.as_ref().map(HomeId::key))
        .bind(&new.label)
        .bind(secret.sha256())
        .bind(now.as_millisecond())
        .bind(new.expires_at.map(Timestamp::as_millisecond))
        .execute(&mut transaction)
        .await?;
        let row = query("SELECT * FROM api_keys WHERE id = $1").bind(id.to_string());
        let key = from_row(&row.fetch_one(&mut transaction).await?)?;
        transaction.commit().await?;
        Ok((key, secret))
    }

    /// Returns whether any key exists: then requests without a key are refused.
    pub async fn has_keys(&self) -> Result<bool, StorageError> {
        let row = query("SELECT id FROM api_keys LIMIT 1");
        Ok(row.fetch_optional(&mut self.database.reader().await?).await?.is_some())
    }

    /// Returns the valid key with this secret, and records its use.
    pub async fn use_key(&self, secret: &Secret, now: Timestamp) -> Result<Option<ApiKey>, StorageError> {
        let row = query("SELECT * FROM api_keys WHERE sha256 = $1").bind(secret.sha256());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        Ok(self.used(row.as_ref().map(from_row).transpose()?, now))
    }

    /// Returns the key if it is valid, and begins to record its use.
    pub(super) fn used(&self, key: Option<ApiKey>, now: Timestamp) -> Option<ApiKey> {
        let key = key.filter(|key| key.is_valid(now));
        if let Some(key) = &key
            && key.last_used_at.is_none_or(|last| now.duration_since(last) > LAST_USE)
        {
            self.key_uses.note(&self.database, key.id, now);
        }
        key
    }

    /// Returns all keys, or a tenant's, including invalid ones, by tenant, oldest first.
    pub async fn keys(&self, tenant: Option<&Tenant>) -> Result<Vec<ApiKey>, StorageError> {
        let rows = query("SELECT * FROM api_keys WHERE $1 IS NULL OR tenant = $1 ORDER BY tenant, id");
        let rows = rows.bind(tenant.map(Tenant::name));
        rows.fetch_all(&mut self.database.reader().await?).await?.iter().map(from_row).collect()
    }

    /// Revokes a key at once; returns false if there is none of this id.
    pub async fn revoke_key(&self, id: Uuid, now: Timestamp) -> Result<bool, StorageError> {
        let revoke = query("UPDATE api_keys SET revoked_at = COALESCE(revoked_at, $2) WHERE id = $1");
        let revoke = revoke.bind(id.to_string()).bind(now.as_millisecond());
        Ok(self.database.execute(revoke).await? > 0)
    }
}
