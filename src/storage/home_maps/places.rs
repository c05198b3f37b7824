//! Update of the clips' placements by a new revision.

use super::MergeClaim;
use crate::storage::changes::{self, Changed};
use crate::storage::columns::{Columns, to_json};
use crate::storage::database::{Transaction, query};
use crate::storage::{ClipState, Placement, StorageError};
use jiff::Timestamp;
use viola_align::Alignment;
use viola_home::{PlacedBy, PlacedClip, Verdict};
use viola_reconstruct::Reason;

/// Updates the clips' placements. An ambiguous clip that its neighbours placed becomes aligned; if they no
/// longer do, it is ambiguous again. A clip with a newer answer stays as it is: its home is due again.
pub(super) async fn tell(
    transaction: &mut Transaction,
    claim: &MergeClaim,
    clips: &[PlacedClip],
    revision: i64,
    now: Timestamp,
) -> Result<(), StorageError> {
    let rows = query("SELECT id, state, result_key FROM clips WHERE home_id = $1 AND placement IS NOT NULL")
        .bind(claim.home.key())
        .fetch_all(transaction)
        .await?;
    for row in &rows {
        let share = row.maybe_text("result_key")?;
        if !claim.members.iter().any(|member| share.as_ref() == Some(&member.share)) {
            query("UPDATE clips SET placement = NULL, updated_at = $2 WHERE id = $1")
                .bind(row.text("id")?)
                .bind(now.as_millisecond())
                .execute(transaction)
                .await?;
            let clip = Changed::Clip { id: row.id("id")?, state: row.name("state")? };
            changes::record(transaction, &claim.home, clip, now).await?;
        }
    }
    for member in &claim.members {
        let placed = clips.iter().find(|placed| placed.share == member.share);
        let placement = placed.map(|placed| Placement {
            map_from_clip: placed.map_from_clip,
            by: placed.by,
            probability: placed.probability,
            map_revision: revision,
        });
        let row =
            query("SELECT state, reasons, placement, alignment FROM clips WHERE id = $1 AND result_key = $2")
                .bind(member.clip.to_string())
                .bind(&member.share)
                .fetch_optional(transaction)
                .await?;
        let Some(row) = row else { continue };
        let same = |old: &Placement| Placement { map_revision: revision, ..old.clone() };
        let before = row.maybe_json::<Placement>("placement")?;
        let ambiguous = matches!(member.verdict, Verdict::Ambiguous { .. });
        // A clip that stays in place is not updated with every revision.
        let unchanged = before.as_ref().map(same) == placement;
        let state = match &placement {
            _ if !ambiguous => row.name("state")?,
            Some(_) => ClipState::Aligned,
            None => ClipState::Ambiguous,
        };
        if unchanged && state == row.name("state")? {
            continue;
        }
        let reasons = match (&placement, ambiguous) {
            (Some(Placement { by: PlacedBy::Neighbours, .. }), _) => to_json(&[decided_by_neighbours()]),
            (None, true) => {
                let own = row.maybe_json::<Alignment>("alignment")?;
                to_json(&own.map(|alignment| alignment.reasons).unwrap_or_default())
            }
            _ => row.text("reasons")?,
        };
        query("UPDATE clips SET state = $2, reasons = $3, placement = $4, updated_at = $5 WHERE id = $1")
            .bind(member.clip.to_string())
            .bind(state.name())
            .bind(reasons)
            .bind(placement.as_ref().map(to_json))
            .bind(now.as_millisecond())
            .execute(transaction)
            .await?;
        changes::record(transaction, &claim.home, Changed::Clip { id: member.clip, state }, now).await?;
    }
    Ok(())
}

fn decided_by_neighbours() -> Reason {
    Reason::new(
        "decided_by_neighbours",
        "several poses explain the clip alike; what the clips around it saw decided between them",
    )
}
