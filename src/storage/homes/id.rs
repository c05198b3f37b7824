//! Names of homes and of whom they belong to.

use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

/// Stands in a key between a tenant and the id of its home; neither may have it.
const BETWEEN: char = '/';

/// Whoever has homes: a company, or a part of one. Tenants never see each other's.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Tenant(String);

impl Tenant {
    /// To whom everything belongs where no keys are used.
    pub const DEFAULT: &str = "default";

    pub fn name(&self) -> &str {
        &self.0
    }

    /// Its home of this id.
    pub fn home(&self, id: &HomeId) -> HomeId {
        let id = id.as_str();
        // As it was before there were tenants.
        if self.0 == Tenant::DEFAULT {
            return HomeId { key: id.to_owned(), id_at: 0 };
        }
        HomeId { key: format!("{}{BETWEEN}{id}", self.0), id_at: self.0.len() + 1 }
    }

    /// Whether the home is its own.
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

/// The id of a home, chosen by the client: 1 to 64 characters of `A-Z a-z 0-9 . _ -`, not `.` or `..`. Within, it also
/// tells the tenant; what is shown and sent is the id alone.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Deserialize)]
#[serde(try_from = "String")]
pub struct HomeId {
    key: String,
    /// Where in the key the id begins.
    id_at: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a home's id is 1 to 64 characters of A-Z a-z 0-9 . _ - and not . or ..")]
pub struct InvalidHomeId;

fn is_good(text: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    !text.is_empty() && text.len() <= 64 && text.bytes().all(allowed) && text != "." && text != ".."
}

impl PartialSchema for HomeId {
    fn schema() -> RefOr<Schema> {
        ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some("The id of a home, chosen by the client; not `.` or `..`"))
            .min_length(Some(1))
            .max_length(Some(64))
            .pattern(Some("^[A-Za-z0-9._-]{1,64}$"))
            .examples(["home-42"])
            .into()
    }
}

impl ToSchema for HomeId {}

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
    /// As its client knows it.
    pub fn as_str(&self) -> &str {
        &self.key[self.id_at..]
    }

    /// The name of its tenant.
    pub fn tenant(&self) -> &str {
        if self.id_at == 0 { Tenant::DEFAULT } else { &self.key[..self.id_at - 1] }
    }

    /// As tables know it, one of its kind among all tenants.
    pub(in crate::storage) fn key(&self) -> &str {
        &self.key
    }

    pub(in crate::storage) fn from_key(key: String) -> Result<HomeId, InvalidHomeId> {
        let id_at = key.find(BETWEEN).map_or(0, |at| at + 1);
        let tenant_is_good = id_at == 0 || is_good(&key[..id_at - 1]);
        if tenant_is_good && is_good(&key[id_at..]) { Ok(HomeId { key, id_at }) } else { Err(InvalidHomeId) }
    }
}
