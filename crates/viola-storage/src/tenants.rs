//! Removal, list and limits of tenants.

mod limits;

pub use limits::TenantLimits;

use super::database::query;
use super::{HomeFilter, Page, Storage, StorageError, Tenant, pending_deletes, uploads};
use jiff::Timestamp;

/// Homes that are looked up at a time.
const BATCH: u32 = 100;

/// Lists the tenants of a table as `of_TABLE`, by one read of an index for each tenant: a table may have millions of rows of one.
macro_rules! tenants_of {
    ($table:literal) => {
        concat!(
            "of_",
            $table,
            " (tenant) AS (SELECT MIN(tenant) FROM ",
            $table,
            " UNION ALL SELECT (SELECT MIN(tenant) FROM ",
            $table,
            " WHERE tenant > last.tenant) FROM of_",
            $table,
            " AS last WHERE last.tenant IS NOT NULL)"
        )
    };
}

/// Selects the tenants of some tables.
macro_rules! tenants_of_all {
    ($first:literal $($more:literal)+) => {
        concat!(
            "WITH RECURSIVE ",
            tenants_of!($first),
            $(", ", tenants_of!($more),)+
            " SELECT tenant FROM (SELECT tenant FROM of_",
            $first,
            $(" UNION SELECT tenant FROM of_", $more,)+
            ") AS known WHERE tenant IS NOT NULL ORDER BY tenant"
        )
    };
}

/// Selects the tenants that have any data.
pub(super) const TENANTS: &str =
    tenants_of_all!("homes" "api_keys" "uploads" "webhooks" "changes" "tenant_limits");

/// Number of items removed with a tenant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Removed {
    pub homes: u64,
    pub uploads: u64,
    pub webhooks: u64,
    pub keys: u64,
}

impl Storage {
    /// Removes a tenant with every row and every byte; after an error it may be called again. Revokes its
    /// keys first, so that nothing new arrives. `progress` receives the number of homes removed so far.
    pub async fn delete_tenant(
        &self,
        tenant: &Tenant,
        now: Timestamp,
        mut progress: impl FnMut(u64),
    ) -> Result<Removed, StorageError> {
        let mut removed = Removed { webhooks: self.end_access(tenant, now).await?, ..Removed::default() };
        loop {
            let page = Page { limit: BATCH, after: None };
            let homes = self.homes(tenant, &HomeFilter::default(), &page).await?;
            if homes.is_empty() {
                break;
            }
            for home in homes {
                match self.delete_home(&home.id, |_| true, now).await {
                    Ok(()) | Err(StorageError::NoSuchHome) => {}
                    Err(error) => return Err(error),
                }
                removed.homes += 1;
                progress(removed.homes);
            }
        }
        let owner = format!("tenant:{}", tenant.name());
        let mut transaction = self.database.begin().await?;
        let pieces = uploads::blob_keys_of_tenant(&mut transaction, tenant).await?;
        pending_deletes::add(&mut transaction, &owner, &pieces, now).await?;
        let delete = query("DELETE FROM uploads WHERE tenant = $1").bind(tenant.name());
        removed.uploads = delete.execute(&mut transaction).await?;
        // Nobody reads the feed of a removed tenant.
        query("DELETE FROM changes WHERE tenant = $1").bind(tenant.name()).execute(&mut transaction).await?;
        transaction.commit().await?;
        self.delete_pending(&owner).await?;
        // Earlier deletions whose store had failed. One pass: other tenants may always have new ones.
        if let Err(error) = self.finish_deletions().await {
            if self.may_have_pending(tenant).await? {
                return Err(error);
            }
            tracing::warn!(%error, "files of other tenants could not be deleted; it is tried again");
        }
        let mut transaction = self.database.begin().await?;
        let totals = query("DELETE FROM tenant_sizes WHERE tenant = $1").bind(tenant.name());
        totals.execute(&mut transaction).await?;
        let limits = query("DELETE FROM tenant_limits WHERE tenant = $1").bind(tenant.name());
        limits.execute(&mut transaction).await?;
        let delete = query("DELETE FROM api_keys WHERE tenant = $1").bind(tenant.name());
        removed.keys = delete.execute(&mut transaction).await?;
        transaction.commit().await?;
        Ok(removed)
    }

    /// Revokes all keys and removes the webhooks; returns the number of webhooks.
    async fn end_access(&self, tenant: &Tenant, now: Timestamp) -> Result<u64, StorageError> {
        let mut transaction = self.database.begin().await?;
        query("UPDATE api_keys SET revoked_at = COALESCE(revoked_at, $2) WHERE tenant = $1")
            .bind(tenant.name())
            .bind(now.as_millisecond())
            .execute(&mut transaction)
            .await?;
        let delete = query("DELETE FROM webhooks WHERE tenant = $1").bind(tenant.name());
        let webhooks = delete.execute(&mut transaction).await?;
        transaction.commit().await?;
        Ok(webhooks)
    }

    /// Returns the tenants that have any data.
    pub async fn tenants(&self) -> Result<Vec<Tenant>, StorageError> {
        let rows = query(TENANTS).fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(|row| row.tenant("tenant")).collect()
    }
}
