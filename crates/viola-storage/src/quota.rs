//! The storage quota of a tenant.

use super::StorageError;
use super::database::{Connection, Transaction, Turn, query, take_turns};

/// Treatment of a new file by its tenant's quota.
#[derive(Debug, Clone, Copy)]
pub(super) enum QuotaCheck {
    /// Its upload was counted already. Concurrent uploads of deferred length may exceed the limit.
    Counted,
    /// `max_bytes` is the limit of a tenant without one of its own; `None` means unlimited.
    Enforce { max_bytes: Option<u64> },
}

/// Returns the size in bytes of a tenant's files, and of its unfinished uploads with all announced bytes.
pub(super) async fn bytes_of(connection: &mut Connection, tenant: &str) -> Result<u64, StorageError> {
    let sum = query(
        "SELECT CAST(
            COALESCE((SELECT SUM(size_bytes) FROM tenant_sizes WHERE tenant = $1), 0)
            + COALESCE((SELECT SUM(COALESCE(length_bytes, received_bytes)) FROM uploads
                WHERE tenant = $1 AND state IN ('arriving', 'arrived')), 0)
        AS BIGINT) AS size_bytes",
    );
    sum.bind(tenant).fetch_one(connection).await?.count("size_bytes")
}

/// Refuses `more_bytes` that exceed the tenant's quota, in the transaction that adds them. Comes after the lock of the home,
/// and before all other locks.
pub(super) async fn check(
    transaction: &mut Transaction,
    tenant: &str,
    more_bytes: u64,
    quota: QuotaCheck,
) -> Result<(), StorageError> {
    let QuotaCheck::Enforce { max_bytes } = quota else { return Ok(()) };
    let row = query("SELECT max_bytes FROM tenant_limits WHERE tenant = $1");
    let row = row.bind(tenant).fetch_optional(transaction).await?;
    let own = row.map(|row| row.maybe_count("max_bytes")).transpose()?.flatten();
    let Some(limit) = own.or(max_bytes) else { return Ok(()) };
    // Two cannot pass the check together.
    take_turns(transaction, Turn::Quota, tenant).await?;
    let used = bytes_of(transaction, tenant).await?;
    if used.saturating_add(more_bytes) > limit {
        return Err(StorageError::TenantFull { used, limit, more: more_bytes });
    }
    Ok(())
}
