//! The effects of jobs on their clips.

use super::result_blobs;
use crate::changes::{self, Changed};
use crate::choice::Verdict;
use crate::columns::to_json;
use crate::database::{Connection, Transaction, query};
use crate::{Choice, ClipState, StorageError, clock, home_maps, homes, lidar_maps};
use jiff::Timestamp;
use uuid::Uuid;
use viola_align::Alignment;
use viola_reconstruct::Reason;

/// Outcome of a job for its clip.
pub(crate) struct Outcome<'a> {
    pub state: ClipState,
    pub reasons: &'a [Reason],
    pub alignment: Option<&'a Alignment>,
    /// Key and size of the result's files.
    pub result: Option<(&'a str, u64)>,
}

/// Applies an outcome of the clip's newest job; an older one cannot overrule it. A choice stays in effect. An answer
/// replaces the last one, and the keys of the last one's blobs are returned.
pub(crate) async fn change(
    connection: &mut Connection,
    job: Uuid,
    outcome: Outcome<'_>,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let before = query(
        "SELECT id, home_id, state, choice, result_key, result_bytes, last_result_key, last_result_bytes
        FROM clips WHERE job_id = $1",
    );
    let before = before.bind(job.to_string()).fetch_optional(&mut *connection).await?;
    let Some(before) = before else { return Ok(Vec::new()) };
    let home = before.home("home_id")?;
    let own = Verdict { state: outcome.state, reasons: outcome.reasons.to_vec() };
    let verdict = match before.maybe_json::<Choice>("choice")? {
        Some(choice) => {
            let revision = lidar_maps::current_revision(connection, &home, choice.level).await?;
            choice.over(own, outcome.result.is_some(), revision)
        }
        None => own,
    };
    // Other clips may place a clip that has no pose by itself.
    if before.maybe_text("result_key")?.is_some() || outcome.result.is_some() {
        home_maps::changed(connection, &home, now).await?;
    }
    let result_bytes = outcome.result.map_or(0, |(_, bytes)| bytes as i64);
    query(concat!(
        "UPDATE clips SET state = $2, reasons = $3, alignment = $4, result_key = $5, result_bytes = $7, ",
        clock::change_at!("$6"),
        " WHERE job_id = $1"
    ))
    .bind(job.to_string())
    .bind(verdict.state.name())
    .bind(to_json(&verdict.reasons))
    .bind(outcome.alignment.map(to_json))
    .bind(outcome.result.map(|(key, _)| key))
    .bind(now.as_millisecond())
    .bind(result_bytes)
    .execute(&mut *connection)
    .await?;
    let mut grown_bytes = result_bytes - before.number("result_bytes")?;
    let mut stale = before.maybe_text("last_result_key")?;
    if outcome.result.is_some() {
        grown_bytes -= before.number("last_result_bytes")?;
        forget_last(connection, job).await?;
    } else {
        stale = None;
    }
    homes::grow(connection, &home, grown_bytes).await?;
    let changed = Changed::Clip { id: before.id("id")?, state: verdict.state };
    changes::record(connection, &home, changed, now).await?;
    Ok(stale.map(|key| result_blobs(&key).to_vec()).unwrap_or_default())
}

async fn forget_last(connection: &mut Connection, job: Uuid) -> Result<(), StorageError> {
    query(
        "UPDATE clips SET last_alignment = NULL, last_result_key = NULL, last_result_bytes = 0,
            last_lidar_map_revision = NULL
        WHERE job_id = $1",
    )
    .bind(job.to_string())
    .execute(connection)
    .await?;
    Ok(())
}

/// Makes a job the clip's newest. The clip keeps the answer of the previous one as its last answer; returns the keys of the
/// blobs of the answer that it no longer keeps.
pub(crate) async fn begin_job(
    transaction: &mut Transaction,
    id: Uuid,
    job: Uuid,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let before = query(
        "SELECT home_id, result_key, last_result_key, last_result_bytes, (SELECT lidar_maps.revision
            FROM jobs JOIN lidar_maps ON lidar_maps.id = jobs.lidar_map_id WHERE jobs.id = clips.job_id) AS revision
        FROM clips WHERE id = $1",
    );
    let before = before.bind(id.to_string()).fetch_one(transaction).await?;
    let mut stale = None;
    if before.maybe_text("result_key")?.is_some() {
        let home = before.home("home_id")?;
        query(
            "UPDATE clips SET last_alignment = alignment, last_result_key = result_key,
                last_result_bytes = result_bytes, last_lidar_map_revision = $2,
                alignment = NULL, result_key = NULL, result_bytes = 0
            WHERE id = $1",
        )
        .bind(id.to_string())
        .bind(before.maybe_number("revision")?.unwrap_or(0))
        .execute(transaction)
        .await?;
        // A process of an earlier version may have left an older answer beside the newer one.
        homes::grow(transaction, &home, -before.number("last_result_bytes")?).await?;
        stale = before.maybe_text("last_result_key")?;
        home_maps::changed(transaction, &home, now).await?;
    }
    query("UPDATE clips SET job_id = $2 WHERE id = $1")
        .bind(id.to_string())
        .bind(job.to_string())
        .execute(transaction)
        .await?;
    let queued = Outcome { state: ClipState::Queued, reasons: &[], alignment: None, result: None };
    change(transaction, job, queued, now).await?;
    Ok(stale.map(|key| result_blobs(&key).to_vec()).unwrap_or_default())
}
