//! `/v1/homes/{home}/map/objects/{object}`, `.../rooms/{room}` and `.../corrections`: corrections of people.

use super::App;
use super::bodies::to_the_end;
use super::error::Error;
use super::extract::{HomePath, Json, Member, ObjectPath, RoomPath, member, wrong};
use super::names;
use super::problems::{CommonProblems, CorrectionProblems, JsonProblems};
use super::reply::{Document, Resource, is_expected};
use super::types::{ClassName, CorrectedObject, CorrectedRoom, Corrections};
use axum::extract::State;
use axum::http::HeaderMap;
use serde::Deserialize;
use serde_json::Value;
use viola_formats::lidar::{MAX_DISTANCE_M, MAX_SIDE_M};
use viola_geometry::taxonomy::Class;
use viola_home::{ObjectCorrection, RoomCorrection};
use viola_storage::{CorrectionState, ObjectChange, RoomChange};

/// Maximum coordinate of a place in the map's frame: that of a LiDAR map, and the side of one for what lies beside it.
const MAX_PLACE_M: f64 = MAX_DISTANCE_M + MAX_SIDE_M;
/// Range of a place's height.
const HEIGHTS_M: [f64; 2] = [-5.0, 20.0];
/// Range of an object's sides.
const SIDES_M: [f64; 2] = [0.02, 20.0];
/// Maximum number of rooms that one room is merged with.
const MAX_MERGED: usize = 8;
/// Minimum distance of the points that give a line.
const MIN_LINE_M: f64 = 0.1;

/// A correction of an object as a JSON Merge Patch: absent members stay, null withdraws.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"class": "sofa", "name": "Grandma's chair"}))]
pub(super) struct ObjectPatch {
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<ClassName>)]
    class: Member,
    /// For people.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<String>, min_length = 1, max_length = 100, pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$")]
    name: Member,
    /// Its centre in the map's frame. The object stays in the map even if no clip shows it there.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<[f64; 3]>, min_items = 3, max_items = 3)]
    centre_m: Member,
    /// Length, width and height; the length is at least the width.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<[f64; 3]>, min_items = 3, max_items = 3)]
    size_m: Member,
    /// Direction of its length.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<f64>)]
    yaw_rad: Member,
    /// True keeps the object as the map has it now, whatever later clips show.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<bool>)]
    pinned: Member,
    /// True removes the object from the map.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<bool>)]
    hidden: Member,
}

/// A correction of a room as a JSON Merge Patch: absent members stay, null withdraws.
#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "Kitchen"}))]
pub(super) struct RoomPatch {
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<String>, min_length = 1, max_length = 100, pattern = "^[^\\x00-\\x1f\\x7f-\\x9f]*[^\\s\\x00-\\x1f\\x7f-\\x9f][^\\x00-\\x1f\\x7f-\\x9f]*$")]
    name: Member,
    /// Ids of rooms at its walls that become one with it, beside those that are already. The room keeps its id, the others
    /// have none.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<Vec<String>>, min_items = 1, max_items = 8)]
    merge_with: Member,
    /// The line that divides it. The part with the room's label keeps its id; the other has this id with `-b`. A room has one
    /// line at a time.
    #[serde(default, deserialize_with = "member")]
    #[schema(value_type = Option<LinePatch>)]
    split_by: Member,
}

/// A line through two points in the map's frame.
#[derive(Debug, utoipa::ToSchema)]
#[expect(dead_code, reason = "it only describes the member")]
pub(super) struct LinePatch {
    #[schema(min_items = 2, max_items = 2)]
    from_m: [f64; 2],
    #[schema(min_items = 2, max_items = 2)]
    to_m: [f64; 2],
}

/// Get an object with its correction
///
/// The `ETag` is for `If-Match` of a correction.
#[utoipa::path(get, path = "/v1/homes/{home}/map/objects/{object}", tag = "map", params(ObjectPath),
    responses((status = 200, description = "The object", body = CorrectedObject), CommonProblems))]
pub(super) async fn get_map_object(
    State(app): State<App>,
    ObjectPath { home, object }: ObjectPath,
) -> Result<Document<CorrectedObject>, Error> {
    Ok(Document(app.storage.corrected::<ObjectCorrection>(&home, &object).await?.into()))
}

/// Correct an object: its class, name or place; pin or hide it
///
/// The body is a JSON Merge Patch (RFC 7396). The correction is kept apart from what the clips say, and holds
/// for the next revision, which follows at once, and for all later ones, even after a new LiDAR map. The
/// answer has the object as the current revision shows it. `null` withdraws a member. A hidden object is
/// listed by `GET .../map/corrections`.
#[utoipa::path(patch, path = "/v1/homes/{home}/map/objects/{object}", tag = "map",
    params(ObjectPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the state to be corrected")),
    request_body(content((ObjectPatch = "application/merge-patch+json"), (ObjectPatch = "application/json"))),
    responses((status = 200, description = "The object with its correction", body = CorrectedObject,
            headers(("ETag" = String, description = "For `If-Match` of the next correction"))),
        CorrectionProblems, CommonProblems, JsonProblems))]
pub(super) async fn correct_map_object(
    State(app): State<App>,
    ObjectPath { home, object }: ObjectPath,
    headers: HeaderMap,
    Json(patch): Json<ObjectPatch>,
) -> Result<Resource<CorrectedObject>, Error> {
    let change = object_change(&patch)?;
    to_the_end(async move {
        let (is_expected, now) =
            (is_expected::<CorrectedObject, CorrectionState<ObjectCorrection>>(headers), app.storage.now());
        let state =
            app.storage.correct::<ObjectCorrection>(&home, &object, &change, is_expected, now).await?;
        app.queue.wake();
        Ok(Resource(CorrectedObject::from(state)))
    })
    .await
}

/// Get a room with its correction
///
/// The `ETag` is for `If-Match` of a correction.
#[utoipa::path(get, path = "/v1/homes/{home}/map/rooms/{room}", tag = "map", params(RoomPath),
    responses((status = 200, description = "The room", body = CorrectedRoom), CommonProblems))]
pub(super) async fn get_map_room(
    State(app): State<App>,
    RoomPath { home, room }: RoomPath,
) -> Result<Document<CorrectedRoom>, Error> {
    Ok(Document(app.storage.corrected::<RoomCorrection>(&home, &room).await?.into()))
}

/// Correct a room: name it, merge it with others, or split it by a line
///
/// The body is a JSON Merge Patch (RFC 7396). The correction holds for the next revision, which follows at
/// once, and for all later ones. It belongs to the place: after a new LiDAR map it holds for the room there,
/// whatever its id. `null` withdraws a member.
#[utoipa::path(patch, path = "/v1/homes/{home}/map/rooms/{room}", tag = "map",
    params(RoomPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the state to be corrected")),
    request_body(content((RoomPatch = "application/merge-patch+json"), (RoomPatch = "application/json"))),
    responses((status = 200, description = "The room with its correction", body = CorrectedRoom,
            headers(("ETag" = String, description = "For `If-Match` of the next correction"))),
        CorrectionProblems, CommonProblems, JsonProblems))]
pub(super) async fn correct_map_room(
    State(app): State<App>,
    RoomPath { home, room }: RoomPath,
    headers: HeaderMap,
    Json(patch): Json<RoomPatch>,
) -> Result<Resource<CorrectedRoom>, Error> {
    let change = room_change(&patch)?;
    to_the_end(async move {
        let (is_expected, now) =
            (is_expected::<CorrectedRoom, CorrectionState<RoomCorrection>>(headers), app.storage.now());
        let state = app.storage.correct::<RoomCorrection>(&home, &room, &change, is_expected, now).await?;
        app.queue.wake();
        Ok(Resource(CorrectedRoom::from(state)))
    })
    .await
}

/// List the corrections of a home, including those of hidden objects
#[utoipa::path(get, path = "/v1/homes/{home}/map/corrections", tag = "map", params(HomePath),
    responses((status = 200, description = "All, at most 500", body = Corrections), CommonProblems))]
pub(super) async fn list_map_corrections(
    State(app): State<App>,
    HomePath { home }: HomePath,
) -> Result<Document<Corrections>, Error> {
    Ok(Document(app.storage.corrections(&home).await?.into()))
}

/// Parses a member that is neither absent nor null.
fn parsed<T>(
    member: &Member,
    parse: impl Fn(&Value) -> Result<T, Error>,
) -> Result<Option<Option<T>>, Error> {
    member.as_ref().map(|value| value.as_ref().map(&parse).transpose()).transpose()
}

fn object_change(patch: &ObjectPatch) -> Result<ObjectChange, Error> {
    let class = |value: &Value| {
        let named = |class: &&Class| value.as_str() == Some(class.name());
        Class::ALL.iter().find(named).copied().ok_or_else(|| wrong("class", "a name of GET /v1/classes"))
    };
    let centre = |value: &Value| {
        let place = numbers::<3>(value).filter(|[x, y, z]| {
            x.abs() <= MAX_PLACE_M && y.abs() <= MAX_PLACE_M && (HEIGHTS_M[0]..=HEIGHTS_M[1]).contains(z)
        });
        place.ok_or_else(|| {
            wrong(
                "centre_m",
                &format!("x, y and z: x and y from -{MAX_PLACE_M} to {MAX_PLACE_M}, z from -5 to 20"),
            )
        })
    };
    let size = |value: &Value| {
        let size = numbers::<3>(value)
            .filter(|size| size.iter().all(|side| (SIDES_M[0]..=SIDES_M[1]).contains(side)));
        let size = size.filter(|size| size[0] >= size[1]);
        size.ok_or_else(|| {
            wrong("size_m", "length, width and height from 0.02 to 20 m; the length is not the shorter")
        })
    };
    let yaw = |value: &Value| {
        let yaw_rad = value.as_f64().filter(|yaw_rad| yaw_rad.abs() <= std::f64::consts::TAU);
        let yaw_rad = yaw_rad.map(|yaw_rad| yaw_rad.rem_euclid(std::f64::consts::PI));
        yaw_rad.ok_or_else(|| wrong("yaw_rad", "in radians, within a whole turn to each side"))
    };
    let flag =
        |field| move |value: &Value| value.as_bool().ok_or_else(|| wrong(field, "true, false or null"));
    Ok(ObjectChange {
        class: parsed(&patch.class, class)?,
        name: parsed(&patch.name, name)?,
        centre_m: parsed(&patch.centre_m, centre)?,
        size_m: parsed(&patch.size_m, size)?,
        yaw_rad: parsed(&patch.yaw_rad, yaw)?,
        pinned: parsed(&patch.pinned, flag("pinned"))?.map(|flag| flag.unwrap_or(false)),
        hidden: parsed(&patch.hidden, flag("hidden"))?.map(|flag| flag.unwrap_or(false)),
    })
}

fn room_change(patch: &RoomPatch) -> Result<RoomChange, Error> {
    let ids = |value: &Value| {
        let ids = value.as_array().filter(|ids| (1..=MAX_MERGED).contains(&ids.len()));
        let ids = ids.and_then(|ids| ids.iter().map(|id| id.as_str().map(str::to_owned)).collect());
        ids.ok_or_else(|| wrong("merge_with", "a list of 1 to 8 ids of rooms"))
    };
    let line = |value: &Value| {
        let members = value.as_object().filter(|members| members.len() == 2);
        let point = |name: &str| numbers::<2>(members?.get(name)?);
        let line = point("from_m").zip(point("to_m")).map(|(from, to)| [from, to]);
        let is_near = |line: &[[f64; 2]; 2]| line.iter().flatten().all(|axis| axis.abs() <= MAX_PLACE_M);
        let is_line = |[from, to]: &[[f64; 2]; 2]| (to[0] - from[0]).hypot(to[1] - from[1]) >= MIN_LINE_M;
        line.filter(is_near).filter(is_line).ok_or_else(|| {
            wrong(
                "split_by",
                &format!(
                    "an object of from_m and to_m: x and y from -{MAX_PLACE_M} to {MAX_PLACE_M}, 0.1 m apart or more"
                ),
            )
        })
    };
    Ok(RoomChange {
        name: parsed(&patch.name, name)?,
        merge_with: parsed(&patch.merge_with, ids)?,
        split_by: parsed(&patch.split_by, line)?,
    })
}

fn name(value: &Value) -> Result<String, Error> {
    let name = value.as_str().filter(|name| names::is_label(name)).map(str::to_owned);
    name.ok_or_else(|| wrong("name", "a text of 1 to 100 characters on one line, not only spaces"))
}

/// Returns the numbers of a list of this length.
fn numbers<const COUNT: usize>(value: &Value) -> Option<[f64; COUNT]> {
    let numbers: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn places_may_be_in_the_farthest_map_and_not_beyond() {
        for (x_m, is_accepted) in [(1001.0, true), (-100_249.0, true), (100_249.0, true), (100_251.0, false)]
        {
            let patch = json!({"centre_m": [x_m, -x_m, 0.5]});
            let patch: ObjectPatch = serde_json::from_value(patch).unwrap();
            assert_eq!(object_change(&patch).is_ok(), is_accepted, "an object at {x_m}");
            let patch = json!({"split_by": {"from_m": [x_m, 0.0], "to_m": [x_m, 1.0]}});
            let patch: RoomPatch = serde_json::from_value(patch).unwrap();
            assert_eq!(room_change(&patch).is_ok(), is_accepted, "a line at {x_m}");
        }
    }
}
