//! Pending deletes: the blobs of deleted resources. They are recorded in the transaction of the deletion, and
//! struck off once the store has removed them. So a deletion succeeds only when every byte is gone, a client
//! can retry it if the store failed, and a process that dies in between leaves no unknown blobs.

use super::columns::to_json;
use super::database::{Row, Transaction, query};
use super::{Storage, StorageError, Tenant};
use jiff::Timestamp;
use uuid::Uuid;

/// Deletions that are read at a time.
const AT_ONCE: i64 = 100;

/// Maximum number of blobs of one deletion: the store removes as many with one request.
const BLOBS_OF_ROW: usize = 1000;

/// Selects the next deletions, oldest first: their ids grow with time. No index has the time, so a page by it would read all of
/// them.
pub(super) const NEXT: &str = "SELECT id, blob_keys FROM doomed_blobs WHERE id > $1 ORDER BY id LIMIT $2";

/// Records blobs to remove, in as many deletions as they need. `owner` names the deleted resource.
pub(super) async fn add(
    transaction: &mut Transaction,
    owner: &str,
    keys: &[String],
    now: Timestamp,
) -> Result<(), StorageError> {
    for keys in keys.chunks(BLOBS_OF_ROW) {
        query("INSERT INTO doomed_blobs (id, owner, blob_keys, created_at) VALUES ($1, $2, $3, $4)")
            .bind(Uuid::now_v7().to_string())
            .bind(owner)
            .bind(to_json(&keys))
            .bind(now.as_millisecond())
            .execute(&mut *transaction)
            .await?;
    }
    Ok(())
}

/// Assigns the pending deletes of all owners `PREFIX:...` to one owner.
pub(super) async fn take_over(
    transaction: &mut Transaction,
    owner: &str,
    prefix: &str,
) -> Result<(), StorageError> {
    // A semicolon sorts right after a colon.
    query("UPDATE doomed_blobs SET owner = $1 WHERE owner >= $2 AND owner < $3")
        .bind(owner)
        .bind(format!("{prefix}:"))
        .bind(format!("{prefix};"))
        .execute(transaction)
        .await?;
    Ok(())
}

/// Returns whether a deletion may be of a tenant's files.
fn may_be_of(owner: &str, tenant: &Tenant) -> bool {
    let (kind, of) = owner.split_once(':').unwrap_or((owner, ""));
    match kind {
        "home" | "clip" | "lidar-map" | "home-map" => {
            let of_tenant = of.split_once('/').map_or(Tenant::DEFAULT, |(of_tenant, _)| of_tenant);
            of_tenant == tenant.name()
        }
        "tenant" => of == tenant.name(),
        // Those of uploads name no tenant.
        _ => true,
    }
}

impl Storage {
    /// Returns whether pending blobs may be a tenant's.
    pub(super) async fn may_have_pending(&self, tenant: &Tenant) -> Result<bool, StorageError> {
        let owners = query("SELECT DISTINCT owner FROM doomed_blobs");
        for row in &owners.fetch_all(&mut self.database.reader().await?).await? {
            if may_be_of(&row.text("owner")?, tenant) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Removes an owner's pending blobs; returns whether there were any.
    pub(super) async fn delete_pending(&self, owner: &str) -> Result<bool, StorageError> {
        let rows = query("SELECT id, blob_keys FROM doomed_blobs WHERE owner = $1 ORDER BY id").bind(owner);
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        for row in &rows {
            self.remove_row(row).await?;
        }
        Ok(!rows.is_empty())
    }

    /// Removes blobs that [`add`] recorded for an owner whose change is committed. If the store fails, a later
    /// [`Storage::finish_deletions`] removes them.
    pub(super) async fn discard_pending(&self, owner: &str, keys: &[String]) {
        if keys.is_empty() {
            return;
        }
        if let Err(error) = self.delete_pending(owner).await {
            tracing::warn!(owner, blobs = keys.len(), %error, "blobs could not be removed; it is tried again");
        }
    }

    /// Removes the blobs of rows that were not added. `is_kept` returns whether a success added them.
    pub(super) async fn discard_unless<T>(
        &self,
        keys: &[String],
        added: &Result<T, StorageError>,
        is_kept: impl FnOnce(&T) -> bool,
    ) {
        let is_kept = match added {
            Ok(added) => is_kept(added),
            // The rows may exist nevertheless; a sweep decides.
            Err(error) => error.is_unsettled(),
        };
        if !is_kept {
            self.blobs.discard(keys).await;
        }
    }

    /// Finishes deletions that were interrupted or whose store failed; returns the number of deletions.
    pub async fn finish_deletions(&self) -> Result<u64, StorageError> {
        self.require_store().await?;
        let (mut finished, mut failed) = (0, None);
        let mut timed_out = false;
        let mut after = String::new();
        loop {
            let rows = query(NEXT).bind(&after).bind(AT_ONCE);
            let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
            for row in &rows {
                after = row.text("id")?;
                let removed = self.remove_row(row).await;
                let earlier_timed_out = timed_out;
                timed_out = removed.as_ref().is_err_and(StorageError::is_timeout);
                match removed {
                    Ok(()) => finished += 1,
                    // The store is silent: each further one would wait as long.
                    Err(error) if timed_out && earlier_timed_out => return Err(error),
                    // One failure does not stop the others.
                    Err(error) => failed = Some(error),
                }
            }
            if (rows.len() as i64) < AT_ONCE {
                return failed.map_or(Ok(finished), Err);
            }
        }
    }

    async fn remove_row(&self, row: &Row) -> Result<(), StorageError> {
        let keys: Vec<String> = row.json("blob_keys")?;
        // Rows of earlier versions have more keys.
        for keys in keys.chunks(BLOBS_OF_ROW) {
            self.blobs.remove_recorded(keys).await?;
        }
        let strike_off = query("DELETE FROM doomed_blobs WHERE id = $1").bind(row.text("id")?);
        self.database.execute(strike_off).await.map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deletion_names_its_tenant() {
        let tenants = [Tenant::DEFAULT, "acme"].map(|name| name.parse::<Tenant>().unwrap());
        for (owner, of) in [
            ("home:h", [true, false]),
            ("home:acme/h", [false, true]),
            ("clip:h:01a1f766-7a97-7747-9dbb-391e0eeccb64", [true, false]),
            ("clip:acme/h:01a1f766-7a97-7747-9dbb-391e0eeccb64", [false, true]),
            ("lidar-map:acme-2/h:main", [false, false]),
            ("home-map:acme/h:", [false, true]),
            ("tenant:acme", [false, true]),
            ("upload:01a1f766-7a97-7747-9dbb-391e0eeccb64", [true, true]),
            ("expired-uploads", [true, true]),
        ] {
            assert_eq!(tenants.each_ref().map(|tenant| may_be_of(owner, tenant)), of, "{owner}");
        }
    }
}
