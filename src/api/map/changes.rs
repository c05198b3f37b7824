//! `/v1/homes/{home}/map/changes`: the changes between two revisions of a map.

use super::scene::scene;
use crate::api::App;
use crate::api::error::{Error, Problem};
use crate::api::extract::{HomePath, Query};
use crate::api::problems::CommonProblems;
use crate::api::types::{GoneObject, GoneReason, MapChanges, MapObject, MovedObject};
use crate::storage::{self, HomeId, MapLevel, MapScene};
use axum::Json;
use axum::extract::State;
use serde::Deserialize;
use viola_geometry::{LevelName, Point2, Pose2};
use viola_home::{PlacedClip, object_changes};

/// The two revisions.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct ChangesQuery {
    /// The earlier revision, 0 for the home before the first; default: the one before `to`.
    #[param(value_type = Option<i64>, minimum = 0)]
    from: Option<String>,
    /// The later revision; default: the current one.
    #[param(value_type = Option<i64>, minimum = 1)]
    to: Option<String>,
}

/// Get the changes of a home's objects between two revisions of its map: added, moved and gone
///
/// The newest five revisions are kept and can be compared. The feed has a change of the kind `objects` for each
/// revision with such changes.
#[utoipa::path(get, path = "/v1/homes/{home}/map/changes", tag = "map", params(HomePath, ChangesQuery),
    responses((status = 200, description = "The changes", body = MapChanges),
        (status = 410, description = "One of the revisions is not kept any more: `map-revision-removed`",
            body = Problem, content_type = "application/problem+json"),
        CommonProblems))]
pub(in crate::api) async fn get_map_changes(
    State(app): State<App>,
    HomePath { home }: HomePath,
    Query(query): Query<ChangesQuery>,
) -> Result<Json<MapChanges>, Error> {
    let current = app.storage.home_map(&home, None).await?.ok_or(Error::NoSuchMap)?.revision;
    let to = number("to", query.to.as_deref(), 1)?.unwrap_or(current);
    let from = number("from", query.from.as_deref(), 0)?.unwrap_or(to - 1);
    if from >= to {
        let detail = format!("from is an earlier revision than to; they are {from} and {to}");
        return Err(Error::InvalidQuery { field: Some("from"), detail });
    }
    let later = Revision::of(&app, &home, to, current).await?;
    let earlier = if from == 0 { None } else { Some(Revision::of(&app, &home, from, current).await?) };
    let clips = app.storage.placed_clips(&home, to).await?;
    Ok(Json(changes(earlier.as_ref(), &later, &clips, (from, to))))
}

fn number(field: &'static str, text: Option<&str>, least: i64) -> Result<Option<i64>, Error> {
    let parse = |text: &str| {
        text.parse::<i64>().ok().filter(|number| *number >= least).ok_or_else(|| Error::InvalidQuery {
            field: Some(field),
            detail: format!("{field} is a number from {least}"),
        })
    };
    text.map(parse).transpose()
}

/// The levels of a revision, with their scenes.
struct Revision {
    levels: Vec<(MapLevel, MapScene)>,
}

impl Revision {
    async fn of(app: &App, home: &HomeId, revision: i64, current: i64) -> Result<Revision, Error> {
        let gone = || {
            let oldest = (current - storage::KEPT_REVISIONS + 1).max(1);
            if revision < oldest { Error::MapRevisionRemoved { revision, oldest } } else { Error::NoSuchMap }
        };
        let map = app.storage.home_map(home, Some(revision)).await?.ok_or_else(gone)?;
        let mut levels = Vec::new();
        for level in &map.levels {
            levels.push((level.clone(), scene(app, home, &map, level.level).await?));
        }
        Ok(Revision { levels })
    }

    fn level(&self, name: LevelName) -> Option<&(MapLevel, MapScene)> {
        self.levels.iter().find(|(level, _)| level.level == name)
    }
}

/// Returns the changes of all levels. No object moves from one level to another.
fn changes(
    earlier: Option<&Revision>,
    later: &Revision,
    clips: &[PlacedClip],
    (from, to): (i64, i64),
) -> MapChanges {
    let mut all = MapChanges { from, to, added: Vec::new(), moved: Vec::new(), gone: Vec::new() };
    for (level, scene) in &later.levels {
        let before = earlier.and_then(|earlier| earlier.level(level.level));
        let clips: Vec<&PlacedClip> = clips.iter().filter(|clip| clip.level_name == level.level).collect();
        add_changes(&mut all, before, scene, &clips);
    }
    all
}

/// Adds the changes of one level.
fn add_changes(
    all: &mut MapChanges,
    earlier: Option<&(MapLevel, MapScene)>,
    later: &MapScene,
    clips: &[&PlacedClip],
) {
    let history = later.history();
    let frame = |(level, _): &(MapLevel, MapScene)| history.frames.get(&level.lidar_map_revision).copied();
    let later_from_earlier = earlier.and_then(frame).unwrap_or(Pose2::IDENTITY);
    let (before, after) = (earlier.map_or(&[][..], |(_, scene)| &scene.objects), &later.objects);
    let found = object_changes(
        &before.iter().map(|object| object.in_frame(&later_from_earlier)).collect::<Vec<_>>(),
        &after.iter().map(|object| object.in_frame(&Pose2::IDENTITY)).collect::<Vec<_>>(),
    );
    let object = |object: &storage::MapObject| MapObject::from(object.clone());
    let gone = |object: &storage::MapObject| {
        let at = later_from_earlier.apply(&Point2::new(object.centre_m[0], object.centre_m[1]));
        let reason = match () {
            () if history.hidden.contains(&object.id) => GoneReason::Hidden,
            () if is_seen_again(object, &at, clips) => GoneReason::SeenAgain,
            () if !clips.iter().any(|clip| object.clips.contains(&clip.clip)) => GoneReason::ClipsRemoved,
            () => GoneReason::NotFound,
        };
        GoneObject { reason, object: MapObject::from(object.clone()) }
    };
    let moved = |(i, j): &(usize, usize)| MovedObject { from: object(&before[*i]), to: object(&after[*j]) };
    all.added.extend(found.added.iter().map(|index| object(&after[*index])));
    all.moved.extend(found.moved.iter().map(moved));
    all.gone.extend(found.gone.iter().map(|index| gone(&before[*index])));
}

/// Returns whether a clip that was recorded after an object was last seen covers its place.
fn is_seen_again(object: &storage::MapObject, at: &Point2, clips: &[&PlacedClip]) -> bool {
    let Some(last_seen) = object.last_seen else { return false };
    clips.iter().any(|clip| {
        let in_clip = clip.map_from_clip.inverse().apply(at);
        let covers =
            (0..2).all(|axis| (clip.extent.min_m[axis]..=clip.extent.max_m[axis]).contains(&in_clip[axis]));
        covers && clip.recorded_at_ms.is_some_and(|at_ms| at_ms > last_seen.as_millisecond())
    })
}
