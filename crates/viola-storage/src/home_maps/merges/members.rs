//! The clips that a merge puts together.

use crate::database::{Connection, Row, query};
use crate::{Choice, ClipState, HomeId, StorageError};
use std::collections::HashMap;
use viola_align::Alignment;
use viola_home::{Member, Verdict};

/// Returns the clips with an answer that may be in the map, one of each recording.
pub(super) async fn members(connection: &mut Connection, home: &HomeId) -> Result<Vec<Member>, StorageError> {
    let rows = query(
        "SELECT id, sha256, content_sha256, recorded_at, result_key, alignment, choice, state FROM clips
        WHERE home_id = $1 AND state IN ('aligned', 'ambiguous', 'failed') AND result_key IS NOT NULL ORDER BY id",
    )
    .bind(home.key())
    .fetch_all(connection)
    .await?;
    let member = |row: &Row| -> Result<Option<(String, Member)>, StorageError> {
        let alignment: Option<Alignment> = row.maybe_json("alignment")?;
        let verdict = match row.maybe_json::<Choice>("choice")? {
            Some(choice) => Some(choice.verdict(alignment.as_ref())),
            None => alignment.as_ref().and_then(Verdict::of),
        };
        // The state is also `failed` if the last attempt broke; the answer is then an older one.
        let broke =
            row.name::<ClipState>("state")? == ClipState::Failed && verdict != Some(Verdict::Unplaced);
        let Some(verdict) = verdict.filter(|_| !broke) else { return Ok(None) };
        let file = row.text("sha256")?;
        let member = Member {
            clip: row.id("id")?,
            recorded_at_ms: row.maybe_number("recorded_at")?,
            sha256: row.maybe_text("content_sha256")?.unwrap_or_else(|| file.clone()),
            contribution: row.text("result_key")?,
            verdict,
        };
        Ok(Some((file, member)))
    };
    let members: Result<_, _> = rows.iter().map(member).filter_map(Result::transpose).collect();
    members.map(one_of_each_recording)
}

/// Keeps one clip of each recording: the first that a person placed, else the first. Each member comes with the SHA-256 of its
/// file: a clip of an earlier version has that alone. A recording that was sent twice, maybe in another archive, is no second
/// evidence: clips that agree by chance would make each other sure.
fn one_of_each_recording(members: Vec<(String, Member)>) -> Vec<Member> {
    let is_chosen = |member: &Member| matches!(member.verdict, Verdict::Chosen { .. });
    let mut kept: Vec<Member> = Vec::with_capacity(members.len());
    let mut places: HashMap<String, usize> = HashMap::new();
    for (file, member) in members {
        let keys = [file, member.sha256.clone()];
        let place = keys.iter().find_map(|key| places.get(key).copied()).unwrap_or(kept.len());
        places.extend(keys.map(|key| (key, place)));
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
    fn a_recording_that_was_sent_twice_is_one_clip() {
        // The SHA-256 of the file, with that of its content after a slash.
        let member = |clip: u128, sums: &str, is_chosen: bool| {
            let (file, content) = sums.split_once('/').unwrap_or((sums, sums));
            let verdict = if is_chosen {
                Verdict::Chosen { level: LevelName::MAIN, map_from_clip: Pose2::IDENTITY, rise_m: 0.0 }
            } else {
                Verdict::Unplaced
            };
            let member = Member {
                clip: Uuid::from_u128(clip),
                recorded_at_ms: None,
                sha256: content.to_owned(),
                contribution: clip.to_string(),
                verdict,
            };
            (file.to_owned(), member)
        };
        for (members, expected) in [
            (vec![(1, "a", false), (2, "b", false), (3, "a", false)], vec![1, 2]),
            (vec![(1, "a", false), (2, "b", false), (3, "a", true), (4, "a", true)], vec![3, 2]),
            (vec![(1, "a", true), (2, "a", false)], vec![1]),
            (vec![(1, "a/x", false), (2, "b/x", false), (3, "c/y", false)], vec![1, 3]),
            (vec![(1, "a/x", false), (2, "b/x", true)], vec![2]),
            // The first is of an earlier version.
            (vec![(1, "a", false), (2, "a/x", false), (3, "b/x", false)], vec![1]),
            (vec![], vec![]),
        ] {
            let members = members.into_iter().map(|(clip, sums, is_chosen)| member(clip, sums, is_chosen));
            let kept = one_of_each_recording(members.collect());
            let kept: Vec<u128> = kept.iter().map(|member| member.clip.as_u128()).collect();
            assert_eq!(kept, expected);
        }
    }
}
