//! `/v1/homes/{home}/map/changes`: the changes between two revisions of a map.

use super::revision::{Revision, number};
use crate::api::App;
use crate::api::error::Error;
use crate::api::extract::{HomePath, Query, invalid_query};
use crate::api::problems::CommonProblems;
use crate::api::reply::Document;
use crate::api::types::{GoneObject, GoneReason, LostObject, LostReason, MapChanges, MapObject, MovedObject};
use axum::extract::State;
use serde::Deserialize;
use viola_geometry::{LevelName, Pose2};
use viola_home::{RevisionObjects, object_changes};
use viola_storage::{KEPT_REVISIONS, MapClip, MapLevel, MapScene, Page};

/// The two revisions.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct ChangesQuery {
    /// The earlier revision, 0 for the home before the first; default: the kept one before `to`.
    #[param(value_type = Option<i64>, minimum = 0)]
    from: Option<String>,
    /// The later revision; default: the current one.
    #[param(value_type = Option<i64>, minimum = 1)]
    to: Option<String>,
}

/// Get the changes of a home's objects between two revisions of its map: added, moved and gone
///
/// An object is added, or gone, if a clip of another time looked through its place. Objects that are in one of the
/// revisions for another reason are `discovered`, `found_again` or `lost`.
///
/// Five revisions are kept and can be compared. The feed has a change of the kind `objects` for each
/// revision with such changes.
#[utoipa::path(get, path = "/v1/homes/{home}/map/changes", tag = "map", params(HomePath, ChangesQuery),
    responses((status = 200, description = "The changes", body = MapChanges),
        (status = 410, description = "One of the revisions is not kept any more: `map-revision-removed`"),
        CommonProblems))]
pub(in crate::api) async fn get_map_changes(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<ChangesQuery>,
) -> Result<Document<MapChanges>, Error> {
    let page = Page { limit: KEPT_REVISIONS as u32, after: None };
    let kept = app.storage.home_map_revisions(&home, &page).await?;
    let current = kept.first().ok_or(Error::NoSuchMap)?.revision;
    let to = number("to", query.to.as_deref(), 1)?.unwrap_or(current);
    let before = kept.iter().map(|map| map.revision).find(|revision| *revision < to);
    let from = number("from", query.from.as_deref(), 0)?.or(before).unwrap_or(to - 1);
    if from >= to {
        let detail = format!("from is an earlier revision than to; they are {from} and {to}");
        return Err(invalid_query("from", detail));
    }
    let later = Compared::of(Revision::kept(&app, home.clone(), Some(to)).await?).await?;
    let earlier = match from {
        0 => None,
        from => Some(Compared::of(Revision::kept(&app, home, Some(from)).await?).await?),
    };
    Ok(Document(changes(earlier.as_ref(), &later, (from, to))))
}

/// The clips and the levels of a revision, with their scenes.
struct Compared {
    clips: Vec<MapClip>,
    levels: Vec<(MapLevel, MapScene)>,
}

impl Compared {
    async fn of(revision: Revision) -> Result<Compared, Error> {
        let mut levels = Vec::new();
        for level in &revision.map.levels {
            levels.push((level.clone(), revision.scene(level.level).await?));
        }
        Ok(Compared { clips: revision.map.clips, levels })
    }

    fn level(&self, name: LevelName) -> Option<&(MapLevel, MapScene)> {
        self.levels.iter().find(|(level, _)| level.level == name)
    }
}

/// Returns the changes of all levels. No object moves from one level to another.
fn changes(earlier: Option<&Compared>, later: &Compared, (from, to): (i64, i64)) -> MapChanges {
    let mut all = MapChanges { from, to, ..MapChanges::default() };
    for (level, scene) in &later.levels {
        let before = earlier.and_then(|earlier| earlier.level(level.level));
        let clips: Vec<&MapClip> = later.clips.iter().filter(|clip| clip.level == level.level).collect();
        add_changes(&mut all, before, scene, &clips);
    }
    let before = earlier.map_or(&[][..], |earlier| &earlier.levels);
    for (_, scene) in before.iter().filter(|(level, _)| later.level(level.level).is_none()) {
        // A level that was removed has no clips any more.
        all.lost.extend(scene.objects.iter().map(|object| LostObject {
            reason: LostReason::ClipsRemoved,
            object: MapObject::from(object.clone()),
        }));
    }
    all
}

/// Adds the changes of one level.
fn add_changes(
    all: &mut MapChanges,
    earlier: Option<&(MapLevel, MapScene)>,
    later: &MapScene,
    clips: &[&MapClip],
) {
    let history = later.history();
    let frame = |(level, _): &(MapLevel, MapScene)| history.frames.get(&level.lidar_map_revision).copied();
    let later_from_earlier = earlier.and_then(frame).unwrap_or(Pose2::IDENTITY);
    let history_before = earlier.map(|(_, scene)| scene.history()).unwrap_or_default();
    let objects_before = earlier.map_or(&[][..], |(_, scene)| &scene.objects);
    let before: Vec<&viola_storage::MapObject> =
        objects_before.iter().chain(&history_before.missing).collect();
    let after = &later.objects;
    let found = object_changes(
        &RevisionObjects {
            objects: earlier.map(|(_, scene)| scene.earlier_objects(&later_from_earlier)).unwrap_or_default(),
            ids: &history_before.ids,
        },
        &RevisionObjects {
            objects: after.iter().map(|object| object.in_frame(&Pose2::IDENTITY)).collect(),
            ids: &history.ids,
        },
    );
    let object = |object: &viola_storage::MapObject| MapObject::from(object.clone());
    let gone =
        |gone: &viola_storage::MapObject, reason: GoneReason| GoneObject { reason, object: object(gone) };
    let lost = |lost: &viola_storage::MapObject| {
        let is_known = clips.iter().any(|clip| lost.clips.contains(&clip.clip));
        let reason = if is_known { LostReason::NotFound } else { LostReason::ClipsRemoved };
        LostObject { reason, object: object(lost) }
    };
    let each = |indices: &[usize], of: &[viola_storage::MapObject]| {
        indices.iter().map(|i| object(&of[*i])).collect::<Vec<_>>()
    };
    let is_hidden = |index: &&usize| history.hidden.contains(&before[**index].id);
    let hidden = found.lost.iter().chain(&found.gone).filter(is_hidden);
    let hidden = hidden.map(|index| gone(before[*index], GoneReason::Hidden));
    let seen_again = found.gone.iter().filter(|index| !is_hidden(index));
    let seen_again = seen_again.map(|index| gone(before[*index], GoneReason::SeenAgain));
    let moved = |(i, j): &(usize, usize)| MovedObject { from: object(before[*i]), to: object(&after[*j]) };
    all.added.extend(each(&found.added, after));
    all.discovered.extend(each(&found.discovered, after));
    all.found_again.extend(each(&found.found_again, after));
    all.moved.extend(found.moved.iter().map(moved));
    all.gone.extend(seen_again.chain(hidden));
    all.lost.extend(found.lost.iter().filter(|index| !is_hidden(index)).map(|index| lost(before[*index])));
}
