//! The key that seals secrets which the service must read again, such as those of webhooks (ChaCha20-Poly1305, RFC 8439).

use super::error::StorageError;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey};
use std::fmt;
use std::str::FromStr;

/// Prefix of a sealed secret; others are in plain text.
pub(super) const SEALED: &str = "sealed:v1:";
const KEY_BYTES: usize = 32;

/// Key that seals secrets.
#[derive(Clone)]
pub struct SecretsKey(LessSafeKey);

impl fmt::Debug for SecretsKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("SecretsKey")
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a secrets key is {KEY_BYTES} random bytes in base64; `openssl rand -base64 {KEY_BYTES}` makes one")]
pub struct InvalidSecretsKey;

impl FromStr for SecretsKey {
    type Err = InvalidSecretsKey;

    fn from_str(text: &str) -> Result<SecretsKey, InvalidSecretsKey> {
        let bytes = BASE64_STANDARD.decode(text.trim()).map_err(|_| InvalidSecretsKey)?;
        // The only possible error is a wrong length.
        let key = UnboundKey::new(&CHACHA20_POLY1305, &bytes).map_err(|_| InvalidSecretsKey)?;
        Ok(SecretsKey(LessSafeKey::new(key)))
    }
}

impl SecretsKey {
    /// Encrypts a secret for the record `owner`; it cannot be opened as another record's.
    pub(super) fn seal(&self, secret: &str, owner: &str) -> Result<String, StorageError> {
        let mut nonce = [0; NONCE_LEN];
        getrandom::fill(&mut nonce).map_err(|error| StorageError::Randomness(error.to_string()))?;
        let mut sealed = secret.as_bytes().to_vec();
        let tag = self.0.seal_in_place_separate_tag(
            Nonce::assume_unique_for_key(nonce),
            Aad::from(owner.as_bytes()),
            &mut sealed,
        );
        let tag = tag.map_err(|_| StorageError::SecretsKey)?;
        Ok(format!("{SEALED}{}", BASE64_STANDARD.encode([&nonce, sealed.as_slice(), tag.as_ref()].concat())))
    }

    /// Decrypts a secret without its prefix; returns none if it was sealed with another key or for another record.
    pub(super) fn open(&self, sealed: &str, owner: &str) -> Option<String> {
        let mut bytes = BASE64_STANDARD.decode(sealed).ok()?;
        let (nonce, rest) = bytes.split_at_mut_checked(NONCE_LEN)?;
        let nonce = Nonce::try_assume_unique_for_key(nonce).ok()?;
        let secret = self.0.open_in_place(nonce, Aad::from(owner.as_bytes()), rest).ok()?;
        String::from_utf8(secret.to_vec()).ok()
    }
}
