//! Update of the clips' placements by a new revision.

use crate::changes::{self, Changed};
use crate::columns::to_json;
use crate::database::{Row, Transaction, query};
use crate::{
    Choice, ClipState, HomeId, Placement, StorageError, clock, reasons_of_placement, state_by_others,
};
use jiff::Timestamp;
use uuid::Uuid;
use viola_align::Alignment;
use viola_home::{Member, PlacedBy, PlacedClip, Verdict};

/// Returns a verdict that is a person's.
fn chosen(verdict: &Verdict) -> Option<Verdict> {
    matches!(verdict, Verdict::Chosen { .. }).then(|| verdict.clone())
}

/// Updates the clips' placements. An ambiguous or failed clip that its neighbours placed becomes aligned; if they
/// no longer do, it is ambiguous or failed again. A clip with a newer answer stays as it is: its home is due again.
pub(super) async fn update_placements(
    transaction: &mut Transaction,
    home: &HomeId,
    members: &[Member],
    clips: &[PlacedClip],
    revision: i64,
    now: Timestamp,
) -> Result<(), StorageError> {
    remove_placements(transaction, home, members, now).await?;
    for member in members {
        let placed = clips.iter().find(|placed| placed.contribution == member.contribution);
        let placement = placed.map(|placed| Placement {
            level: placed.level,
            map_from_clip: placed.map_from_clip,
            rise_m: placed.rise_m,
            by: placed.by,
            probability: placed.probability,
            map_revision: revision,
            answer: (placed.by == PlacedBy::Neighbours).then(|| placed.contribution.clone()),
        });
        update_placement(transaction, home, member, placement, revision, now).await?;
    }
    Ok(())
}

/// Removes the placements of clips whose present answer is not a member's.
async fn remove_placements(
    transaction: &mut Transaction,
    home: &HomeId,
    members: &[Member],
    now: Timestamp,
) -> Result<(), StorageError> {
    let rows = query("SELECT id, result_key FROM clips WHERE home_id = $1 AND placement IS NOT NULL")
        .bind(home.key())
        .fetch_all(transaction)
        .await?;
    for row in &rows {
        let contribution = row.maybe_text("result_key")?;
        if !members.iter().any(|member| contribution.as_ref() == Some(&member.contribution)) {
            remove_placement(transaction, home, row.id("id")?, now).await?;
        }
    }
    Ok(())
}

/// Removes the placement of a clip. If other clips had decided its pose, its state and reasons are those of its own answer again.
async fn remove_placement(
    transaction: &mut Transaction,
    home: &HomeId,
    id: Uuid,
    now: Timestamp,
) -> Result<(), StorageError> {
    let row = query("SELECT state, alignment, choice FROM clips WHERE id = $1").bind(id.to_string());
    let row = row.fetch_one(transaction).await?;
    let state: ClipState = row.name("state")?;
    let is_chosen = row.maybe_text("choice")?.is_some();
    let is_by_others =
        |own: &Alignment| !is_chosen && state == ClipState::Aligned && ClipState::from(own.state) != state;
    let own = row.maybe_json::<Alignment>("alignment")?.filter(is_by_others);
    let own_state = own.as_ref().map(|own| ClipState::from(own.state));
    // A claim may change the state of a queued clip meanwhile.
    query(concat!(
        "UPDATE clips SET placement = NULL, state = COALESCE($3, state), reasons = COALESCE($4, reasons), ",
        clock::change_at!("$2"),
        " WHERE id = $1"
    ))
    .bind(id.to_string())
    .bind(now.as_millisecond())
    .bind(own_state.map(ClipState::name))
    .bind(own.map(|own| to_json(&own.reasons)))
    .execute(transaction)
    .await?;
    let state = own_state.unwrap_or(state);
    changes::record(transaction, home, Changed::Clip { id, state }, now).await
}

/// Updates the placement of one clip, and its state and reasons.
async fn update_placement(
    transaction: &mut Transaction,
    home: &HomeId,
    member: &Member,
    placement: Option<Placement>,
    revision: i64,
    now: Timestamp,
) -> Result<(), StorageError> {
    let row = query(
        "SELECT state, reasons, placement, alignment, choice FROM clips WHERE id = $1 AND result_key = $2",
    )
    .bind(member.clip.to_string())
    .bind(&member.contribution)
    .fetch_optional(transaction)
    .await?;
    let Some(row) = row else { return Ok(()) };
    // A person chose or withdrew meanwhile, and the home is due again.
    let choice = match row.maybe_json::<Choice>("choice")? {
        Some(choice) => Some(choice.verdict(row.maybe_json::<Alignment>("alignment")?.as_ref())),
        None => None,
    };
    if choice != chosen(&member.verdict) {
        return Ok(());
    }
    let same = |old: &Placement| {
        let answer = old.answer.clone().or_else(|| placement.as_ref()?.answer.clone());
        Placement { map_revision: revision, answer, ..old.clone() }
    };
    let before = row.maybe_json::<Placement>("placement")?;
    // A clip that stays in place is not updated with every revision.
    let unchanged = before.as_ref().map(same) == placement;
    let by = placement.as_ref().map(|placement| placement.by);
    let open = state_by_others(&member.verdict, by);
    let state = open.map_or_else(|| row.name("state"), Ok)?;
    if unchanged && state == row.name("state")? {
        return Ok(());
    }
    let update = concat!(
        "UPDATE clips SET state = $2, reasons = $3, placement = $4, ",
        clock::change_at!("$5"),
        " WHERE id = $1"
    );
    query(update)
        .bind(member.clip.to_string())
        .bind(state.name())
        .bind(reasons_json(&row, by, open.is_some())?)
        .bind(placement.as_ref().map(to_json))
        .bind(now.as_millisecond())
        .execute(transaction)
        .await?;
    changes::record(transaction, home, Changed::Clip { id: member.clip, state }, now).await
}

/// Returns the reasons of a clip after the merge. `is_open` is true if the clip's own alignment left its pose open.
fn reasons_json(row: &Row, by: Option<PlacedBy>, is_open: bool) -> Result<String, StorageError> {
    match reasons_of_placement(by) {
        Some(reasons) => Ok(to_json(&reasons)),
        None if by.is_none() && is_open => {
            let own = row.maybe_json::<Alignment>("alignment")?;
            Ok(to_json(&own.map(|alignment| alignment.reasons).unwrap_or_default()))
        }
        None => row.text("reasons"),
    }
}
