//! Merges that ended without a result. The pauses of a home double with every such merge in a row: one that fails each
//! time must not keep a worker busy.

use super::{MergeClaim, damage};
use crate::database::{Row, Transaction, query};
use crate::{RetryPolicy, Storage, StorageError, clock};
use jiff::Timestamp;
use std::time::Duration;
use uuid::Uuid;
use viola_home::Member;

/// Returns the pause after a merge without a result. `may_have_passed` is true if its cause is probably over: then the
/// first retry comes at once.
fn pause(earlier_faults: u32, may_have_passed: bool) -> Duration {
    match earlier_faults {
        0 if may_have_passed => Duration::ZERO,
        earlier => RetryPolicy::default().delay(earlier.saturating_add(1)),
    }
}

impl Storage {
    /// Gives a claim back after an error, which counts; the merge is due again after a pause. `damaged` is the clip whose files
    /// were missing or damaged, if that was the error: it gets a reason.
    pub async fn fail_merge(
        &self,
        claim: &MergeClaim,
        damaged: Option<Uuid>,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        // The clip may have been removed meanwhile.
        let due = now + pause(claim.faults, damaged.is_some());
        let mut transaction = self.database.begin().await?;
        let held = query(
            "UPDATE homes SET map_lease_until = NULL, map_due_at = $3, map_faults = map_faults + 1
            WHERE id = $1 AND map_fence = $2 AND created_at = $4",
        )
        .bind(claim.home.key())
        .bind(claim.fencing_token)
        .bind(due.as_millisecond())
        .bind(claim.home_created_at.as_millisecond());
        if held.execute(&mut transaction).await? > 0 {
            let of_claim = claim.members.iter().filter(|member| Some(member.clip) == damaged);
            let left_out: Vec<Member> = of_claim.cloned().collect();
            damage::update_reasons(&mut transaction, &claim.home, &left_out, &[], now).await?;
        }
        transaction.commit().await
    }
}

/// Ends a claim whose home this version cannot read, which counts as a fault. `row` is that of the claim.
pub(super) async fn set_aside(
    transaction: &mut Transaction,
    row: &Row,
    now: Timestamp,
) -> Result<(), StorageError> {
    end(transaction, row, false, now).await
}

/// Ends the claim of a home's row without a result, which counts as a fault.
async fn end(
    transaction: &mut Transaction,
    row: &Row,
    may_have_passed: bool,
    now: Timestamp,
) -> Result<(), StorageError> {
    let due = now + pause(row.count("map_faults")?, may_have_passed);
    query(
        "UPDATE homes SET map_lease_until = NULL, map_due_at = $2, map_faults = map_faults + 1,
            map_fence = map_fence + 1
        WHERE id = $1",
    )
    .bind(row.text("id")?)
    .bind(due.as_millisecond())
    .execute(transaction)
    .await?;
    Ok(())
}

/// Ends the claims whose lease expired. The merge may have killed its worker, so each counts as a fault.
pub(super) async fn release_lost(transaction: &mut Transaction, now: Timestamp) -> Result<(), StorageError> {
    let lost = query(
        "SELECT id, map_faults FROM homes
        WHERE map_lease_until IS NOT NULL AND (map_lease_until <= $1 OR map_lease_until > $2)
        ORDER BY map_lease_until FOR NO KEY UPDATE SKIP LOCKED",
    );
    let lost = lost.bind(now.as_millisecond()).bind(clock::no_lease_after(now));
    for row in &lost.fetch_all(transaction).await? {
        // The first time, the process was probably restarted.
        end(transaction, row, true, now).await?;
    }
    Ok(())
}
