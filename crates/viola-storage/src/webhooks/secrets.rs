//! Sealed secrets of webhooks: in the database they are encrypted with a key of the operator's, so that a copy of the database
//! reveals none.

use super::super::database::query;
use super::super::seal::SEALED;
use super::super::{Storage, StorageError};

impl Storage {
    /// Returns a secret as it is to be stored: sealed if the operator has given a key.
    pub(crate) fn seal(&self, secret: &str, owner: &str) -> Result<String, StorageError> {
        match &self.secrets_key {
            Some(key) => key.seal(secret, owner),
            None => Ok(secret.to_owned()),
        }
    }

    /// Returns a stored secret in plain text.
    pub(crate) fn unseal(&self, stored: &str, owner: &str) -> Result<String, StorageError> {
        let Some(sealed) = stored.strip_prefix(SEALED) else { return Ok(stored.to_owned()) };
        let key = self.secrets_key.as_ref().ok_or(StorageError::SecretsKey)?;
        key.open(sealed, owner).ok_or(StorageError::SecretsKey)
    }

    /// Checks that the stored secrets can be opened, and seals those from the time without a key.
    pub(crate) async fn seal_secrets(&self) -> Result<(), StorageError> {
        let rows = query("SELECT id, secret FROM webhooks ORDER BY id");
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        for row in &rows {
            let (id, secret) = (row.text("id")?, row.text("secret")?);
            self.unseal(&secret, &id)?;
            if self.secrets_key.is_none() || secret.starts_with(SEALED) {
                continue;
            }
            let update = query("UPDATE webhooks SET secret = $3 WHERE id = $1 AND secret = $2")
                .bind(&id)
                .bind(&secret)
                .bind(self.seal(&secret, &id)?);
            self.database.execute(update).await?;
        }
        Ok(())
    }
}
