//! The clips that a merge puts together.

use crate::columns::Columns;
use crate::database::{Connection, Row, query};
use crate::{Choice, ClipState, HomeId, StorageError};
use std::collections::HashMap;
use viola_align::Alignment;
use viola_home::{Member, Verdict};

/// Returns the clips with an answer that may be in the map, one of each file.
pub(super) async fn members(connection: &mut Connection, home: &HomeId) -> Result<Vec<Member>, StorageError> {
    let rows = query(
        "SELECT id, sha256, recorded_at, result_key, alignment, choice, state FROM clips
        WHERE home_id = $1 AND state IN ('aligned', 'ambiguous', 'failed') AND result_key IS NOT NULL ORDER BY id",
    )
    .bind(home.key())
    .fetch_all(connection)
    .await?;
    let member = |row: &Row| -> Result<Option<Member>, StorageError> {
        let alignment: Option<Alignment> = row.maybe_json("alignment")?;
        let verdict = match row.maybe_json::<Choice>("choice")? {
            Some(choice) => Some(choice.verdict()),
            None => alignment.as_ref().and_then(Verdict::of),
        };
        // The state is also `failed` if the last attempt broke; the answer is then an older one.
        let broke =
            row.name::<ClipState>("state")? == ClipState::Failed && verdict != Some(Verdict::Unplaced);
        let Some(verdict) = verdict.filter(|_| !broke) else { return Ok(None) };
        Ok(Some(Member {
            clip: row.id("id")?,
            recorded_at_ms: row.maybe_number("recorded_at")?,
            sha256: row.text("sha256")?,
            contribution: row.text("result_key")?,
            verdict,
        }))
    };
    let members: Result<_, _> = rows.iter().map(member).filter_map(Result::transpose).collect();
    members.map(one_of_each_file)
}

/// Keeps one clip of each file: the first that a person placed, else the first. A file that was sent twice is no second
/// evidence: clips that agree by chance would make each other sure.
fn one_of_each_file(members: Vec<Member>) -> Vec<Member> {
    let is_chosen = |member: &Member| matches!(member.verdict, Verdict::Chosen { .. });
    let mut kept: Vec<Member> = Vec::with_capacity(members.len());
    let mut places: HashMap<String, usize> = HashMap::new();
    for member in members {
        let place = *places.entry(member.sha256.clone()).or_insert(kept.len());
        match kept.get_mut(place) {
            None => kept.push(member),
            Some(first) if is_chosen(&member) && !is_chosen(first) => *first = member,
            Some(_) => {}
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;
    use viola_geometry::{LevelName, Pose2};

    #[test]
    fn a_file_that_was_sent_twice_is_one_clip() {
        let member = |clip: u128, sha256: &str, is_chosen: bool| Member {
            clip: Uuid::from_u128(clip),
            recorded_at_ms: None,
            sha256: sha256.to_owned(),
            contribution: clip.to_string(),
            verdict: if is_chosen {
                Verdict::Chosen { level: LevelName::MAIN, map_from_clip: Pose2::new(0.0, 0.0, 0.0) }
            } else {
                Verdict::Unplaced
            },
        };
        for (members, expected) in [
            (vec![(1, "a", false), (2, "b", false), (3, "a", false)], vec![1, 2]),
            (vec![(1, "a", false), (2, "b", false), (3, "a", true), (4, "a", true)], vec![3, 2]),
            (vec![(1, "a", true), (2, "a", false)], vec![1]),
            (vec![], vec![]),
        ] {
            let members =
                members.into_iter().map(|(clip, sha256, is_chosen)| member(clip, sha256, is_chosen));
            let kept: Vec<u128> =
                one_of_each_file(members.collect()).iter().map(|member| member.clip.as_u128()).collect();
            assert_eq!(kept, expected);
        }
    }
}
