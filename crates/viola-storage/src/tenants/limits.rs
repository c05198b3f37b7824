//! Limits of tenants, and what counts towards them.

use crate::database::query;
use crate::{Storage, StorageError, Tenant, quota};

/// Limits of a tenant in place of the service's; `None` means the service's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TenantLimits {
    /// Size of its files.
    pub max_bytes: Option<u64>,
    /// Number of its unfinished uploads.
    pub max_uploads: Option<u64>,
}

impl Storage {
    /// Returns the limits that were set for a tenant.
    pub async fn tenant_limits(&self, tenant: &Tenant) -> Result<TenantLimits, StorageError> {
        let row = query("SELECT max_bytes, max_uploads FROM tenant_limits WHERE tenant = $1");
        let row = row.bind(tenant.name()).fetch_optional(&mut self.database.reader().await?).await?;
        let Some(row) = row else { return Ok(TenantLimits::default()) };
        Ok(TenantLimits {
            max_bytes: row.maybe_count("max_bytes")?,
            max_uploads: row.maybe_count("max_uploads")?,
        })
    }

    /// Sets all limits of a tenant.
    pub async fn set_tenant_limits(
        &self,
        tenant: &Tenant,
        limits: &TenantLimits,
    ) -> Result<(), StorageError> {
        let number = |limit: Option<u64>| limit.map(|limit| i64::try_from(limit).unwrap_or(i64::MAX));
        let set = query(
            "INSERT INTO tenant_limits (tenant, max_bytes, max_uploads) VALUES ($1, $2, $3)
            ON CONFLICT (tenant) DO UPDATE SET max_bytes = excluded.max_bytes, max_uploads = excluded.max_uploads",
        )
        .bind(tenant.name())
        .bind(number(limits.max_bytes))
        .bind(number(limits.max_uploads));
        self.database.execute(set).await.map(drop)
    }

    /// Returns the size in bytes of a tenant's files: clips, LiDAR maps, results, the maps of homes, and
    /// unfinished uploads with all the bytes that their clients announced.
    pub async fn tenant_bytes(&self, tenant: &Tenant) -> Result<u64, StorageError> {
        quota::bytes_of(&mut self.database.reader().await?, tenant.name()).await
    }

    /// Returns the number of a tenant's unfinished uploads.
    pub async fn unfinished_uploads(&self, tenant: &Tenant) -> Result<u64, StorageError> {
        let number = query(
            "SELECT COUNT(*) AS uploads FROM uploads WHERE tenant = $1 AND state IN ('arriving', 'arrived')",
        );
        let number = number.bind(tenant.name()).fetch_one(&mut self.database.reader().await?).await?;
        number.count("uploads")
    }
}
