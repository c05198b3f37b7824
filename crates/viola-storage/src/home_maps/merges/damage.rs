//! The reason of clips that a merge leaves out, since the files of their answers cannot be read.

use crate::changes::{self, Changed};
use crate::columns::to_json;
use crate::database::{Transaction, query};
use crate::{HomeId, StorageError, clock};
use jiff::Timestamp;
use viola_home::Member;
use viola_reconstruct::Reason;

const CODE: &str = "results_damaged";

/// Gives the clips that a merge left out their reason, and takes it from those that it read. Clips with a newer answer stay as
/// they are, and so do the states of all clips.
pub(super) async fn update_reasons(
    transaction: &mut Transaction,
    home: &HomeId,
    left_out: &[Member],
    read: &[Member],
    now: Timestamp,
) -> Result<(), StorageError> {
    if left_out.is_empty() && read.is_empty() {
        return Ok(());
    }
    let rows = query(
        "SELECT id, result_key, state, reasons FROM clips WHERE home_id = $1 AND result_key IS NOT NULL ORDER BY id",
    );
    for row in &rows.bind(home.key()).fetch_all(transaction).await? {
        let (id, result_key) = (row.id("id")?, row.text("result_key")?);
        let is_of = |member: &Member| member.clip == id && member.contribution == result_key;
        let mut reasons: Vec<Reason> = row.json("reasons")?;
        let has_reason = reasons.iter().any(|reason| reason.code == CODE);
        if !has_reason && left_out.iter().any(is_of) {
            let detail = "the home's map cannot take the clip: files of its answer are missing or damaged";
            reasons.push(Reason::new(CODE, detail));
        } else if has_reason && read.iter().any(is_of) {
            reasons.retain(|reason| reason.code != CODE);
        } else {
            continue;
        }
        query(concat!("UPDATE clips SET reasons = $2, ", clock::change_at!("$3"), " WHERE id = $1"))
            .bind(id.to_string())
            .bind(to_json(&reasons))
            .bind(now.as_millisecond())
            .execute(transaction)
            .await?;
        changes::record(transaction, home, Changed::Clip { id, state: row.name("state")? }, now).await?;
    }
    Ok(())
}
