//! Ids of homes and names of tenants.

use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Separates a tenant from the id of its home in a key; neither may contain it.
const BETWEEN: char = '/';

/// An owner of homes: a company, or a part of one. Tenants never see each other's homes.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Tenant(String);

impl Tenant {
    /// Tenant that owns everything if no API keys are used.
    pub const DEFAULT: &str = "default";

    pub fn name(&self) -> &str {
        &self.0
    }

    /// Returns the tenant's home with this id.
    pub fn home(&self, id: &HomeId) -> HomeId {
        let prefix = self.key_prefix();
        HomeId { id_at: prefix.len(), key: prefix + id.as_str() }
    }

    /// Returns the part of its homes' keys before their ids; empty for the default tenant.
    pub(crate) fn key_prefix(&self) -> String {
        if self.0 == Tenant::DEFAULT { String::new() } else { format!("{}{BETWEEN}", self.0) }
    }

    /// Returns whether the home belongs to this tenant.
    pub fn has(&self, home: &HomeId) -> bool {
        self.0 == home.tenant()
    }
}

impl Default for Tenant {
    fn default() -> Tenant {
        Tenant(Tenant::DEFAULT.to_owned())
    }
}

impl From<Tenant> for String {
    fn from(tenant: Tenant) -> String {
        tenant.0
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a tenant's name is 1 to 64 characters of A-Z a-z 0-9 . _ - and not . or ..")]
pub struct InvalidTenant;

impl TryFrom<String> for Tenant {
    type Error = InvalidTenant;

    fn try_from(name: String) -> Result<Tenant, InvalidTenant> {
        if is_good(&name) { Ok(Tenant(name)) } else { Err(InvalidTenant) }
    }
}

impl FromStr for Tenant {
    type Err = InvalidTenant;

    fn from_str(name: &str) -> Result<Tenant, InvalidTenant> {
        Tenant::try_from(name.to_owned())
    }
}

/// The id of a home, chosen by the client: 1 to 64 characters of `A-Z a-z 0-9 . _ -`, not `.` or `..`.
/// Internally it includes the tenant; only the id is shown and sent.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Deserialize)]
#[serde(try_from = "String")]
pub struct HomeId {
    key: String,
    /// Offset of the id in the key.
    id_at: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a home's id is 1 to 64 characters of A-Z a-z 0-9 . _ - and not . or ..")]
pub struct InvalidHomeId;

fn is_good(text: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    !text.is_empty() && text.len() <= 64 && text.bytes().all(allowed) && text != "." && text != ".."
}

impl TryFrom<String> for HomeId {
    type Error = InvalidHomeId;

    fn try_from(text: String) -> Result<HomeId, InvalidHomeId> {
        if is_good(&text) { Ok(HomeId { key: text, id_at: 0 }) } else { Err(InvalidHomeId) }
    }
}

impl FromStr for HomeId {
    type Err = InvalidHomeId;

    fn from_str(text: &str) -> Result<HomeId, InvalidHomeId> {
        HomeId::try_from(text.to_owned())
    }
}

impl Serialize for HomeId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl fmt::Display for HomeId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

impl HomeId {
    /// Returns the id as the client knows it.
    pub fn as_str(&self) -> &str {
        &self.key[self.id_at..]
    }

    /// Returns the name of its tenant.
    pub fn tenant(&self) -> &str {
        if self.id_at == 0 { Tenant::DEFAULT } else { &self.key[..self.id_at - 1] }
    }

    /// Returns the key in tables, unique among all tenants.
    pub(crate) fn key(&self) -> &str {
        &self.key
    }

    pub(crate) fn from_key(key: String) -> Result<HomeId, InvalidHomeId> {
        let id_at = key.find(BETWEEN).map_or(0, |at| at + 1);
        let tenant_is_good = id_at == 0 || is_good(&key[..id_at - 1]);
        if tenant_is_good && is_good(&key[id_at..]) { Ok(HomeId { key, id_at }) } else { Err(InvalidHomeId) }
    }
}
