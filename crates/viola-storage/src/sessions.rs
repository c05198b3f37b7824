//! Sessions of browsers: a random token in place of the key. A session ends after [`SESSION_LIFE`], when its person signs
//! out, and with its key.

use super::database::query;
use super::keys::{ApiKey, from_row, random_hexadecimal, sha256};
use super::{Storage, StorageError};
use jiff::{SignedDuration, Timestamp};
use std::fmt;
use std::str::FromStr;
use uuid::Uuid;

/// Lifetime of a session, whether it is used or not.
pub const SESSION_LIFE: SignedDuration = SignedDuration::from_hours(12);

/// Maximum number of sessions of a key; a further one ends the oldest.
const MAX_SESSIONS: i64 = 100;

const TOKEN_BYTES: usize = 32;

/// Secret of a session, which a browser presents. It is never logged.
#[derive(Clone, PartialEq, Eq)]
pub struct SessionToken(String);

impl fmt::Debug for SessionToken {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("SessionToken")
    }
}

impl FromStr for SessionToken {
    type Err = ();

    fn from_str(text: &str) -> Result<SessionToken, ()> {
        let is_good = text.len() == 2 * TOKEN_BYTES && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        if is_good { Ok(SessionToken(text.to_owned())) } else { Err(()) }
    }
}

impl SessionToken {
    /// Returns the token in plain text, for the cookie.
    pub fn show(&self) -> &str {
        &self.0
    }

    /// Returns the SHA-256 by which the service knows the token.
    pub fn sha256(&self) -> String {
        sha256(&self.0)
    }
}

impl Storage {
    /// Begins a session with the rights of a key. Only this call returns the token.
    pub async fn begin_session(&self, key: Uuid, now: Timestamp) -> Result<SessionToken, StorageError> {
        let token = SessionToken(random_hexadecimal::<TOKEN_BYTES>()?);
        let mut transaction = self.database.begin().await?;
        query("DELETE FROM sessions WHERE expires_at <= $1")
            .bind(now.as_millisecond())
            .execute(&mut transaction)
            .await?;
        query(
            "DELETE FROM sessions WHERE key_id = $1 AND sha256 NOT IN
                (SELECT sha256 FROM sessions WHERE key_id = $1 ORDER BY created_at DESC, sha256 LIMIT $2)",
        )
        .bind(key.to_string())
        .bind(MAX_SESSIONS - 1)
        .execute(&mut transaction)
        .await?;
        query("INSERT INTO sessions (sha256, key_id, created_at, expires_at) VALUES ($1, $2, $3, $4)")
            .bind(token.sha256())
            .bind(key.to_string())
            .bind(now.as_millisecond())
            .bind((now + SESSION_LIFE).as_millisecond())
            .execute(&mut transaction)
            .await?;
        transaction.commit().await?;
        Ok(token)
    }

    /// Returns the key of a session, if both are valid.
    pub async fn use_session(
        &self,
        token: &SessionToken,
        now: Timestamp,
    ) -> Result<Option<ApiKey>, StorageError> {
        let row = query(
            "SELECT api_keys.* FROM sessions JOIN api_keys ON api_keys.id = sessions.key_id
            WHERE sessions.sha256 = $1 AND sessions.expires_at > $2",
        );
        let row = row.bind(token.sha256()).bind(now.as_millisecond());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        Ok(self.used(row.as_ref().map(from_row).transpose()?, now))
    }

    /// Ends a session; one that does not exist is no error.
    pub async fn end_session(&self, token: &SessionToken) -> Result<(), StorageError> {
        let end = query("DELETE FROM sessions WHERE sha256 = $1").bind(token.sha256());
        self.database.execute(end).await.map(drop)
    }
}
