//! `/v1/homes/{home}/clips/{clip}/alignment`: the pose of a clip that a person chooses.

use super::App;
use super::bodies::to_the_end;
use super::error::Error;
use super::extract::{ClipPath, Json, Member, member, wrong};
use super::problems::{ChangedClip, CommonProblems, JsonProblems};
use super::reply::{Resource, is_expected};
use super::types::{self, Clip};
use axum::extract::State;
use axum::http::HeaderMap;
use serde::Deserialize;
use serde_json::Value;
use viola_geometry::{LevelName, Pose2};
use viola_storage::{ChoiceError, Chosen, StorageError};

/// Maximum angle: a larger one is probably in degrees.
const MAX_YAW_RAD: f64 = std::f64::consts::TAU;

/// A person's choice. The values are parsed by hand, so that a refusal names the member at fault.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ChoiceBody {
    #[serde(default, deserialize_with = "member")]
    alternative: Member,
    #[serde(default, deserialize_with = "member")]
    map_from_clip: Member,
    #[serde(default)]
    level: Option<Value>,
}

/// A person's choice: one of the alternatives, or a pose.
#[derive(Debug, utoipa::ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "it only describes the body")]
pub(super) enum Choose {
    Alternative(ChooseAlternative),
    Pose(ChoosePose),
}

/// One of the clip's alternatives.
#[derive(Debug, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"alternative": 1}))]
#[expect(dead_code, reason = "it only describes the body")]
pub(super) struct ChooseAlternative {
    /// Index into the present `alignment.alternatives` of the clip, from 0.
    alternative: u32,
}

/// A pose in the LiDAR map of a level.
#[derive(Debug, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "it only describes the body")]
pub(super) struct ChoosePose {
    /// The pose itself, in the frame of the current LiDAR map: within 10 m of what the map spans.
    map_from_clip: types::Pose2,
    /// The level in whose LiDAR map `map_from_clip` is; default: `main`.
    level: Option<types::LevelName>,
}

/// Choose the pose of a clip
///
/// Give one of the clip's alternatives or a pose of your own. The clip is then `aligned` with the reason
/// `chosen_by_person`, and `choice` has the chosen pose; the method's own answer stays in `alignment`. The
/// choice holds for every new alignment until it is withdrawn or replaced. It also holds after a new LiDAR
/// map: its pose is moved into the new frame, with the reason `choice_carried_over`, if the two maps could be registered
/// to each other; otherwise it stays, with the reason `choice_of_earlier_lidar_map`, and a person should check it.
///
/// A pose may be given at any time. While a job is under way, it takes effect when the job ends. A clip
/// without a result keeps its state, with the reason `choice_without_result`, until a job gives it a result.
/// The same choice again changes nothing.
#[utoipa::path(put, path = "/v1/homes/{home}/clips/{clip}/alignment", tag = "clips",
    params(ClipPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the clip as it was read")),
    request_body = Choose,
    responses(
        (status = 200, description = "The clip with the choice", body = Clip,
            headers(("ETag" = String, description = "For `If-Match` of the next change"))),
        (status = 409, description = "The clip has no answer yet, so it has no alternatives: `no-answer-yet`; \
            or the home has no LiDAR map, so a pose has no frame: `no-lidar-map`"),
        ChangedClip, CommonProblems, JsonProblems))]
pub(super) async fn choose_alignment(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
    headers: HeaderMap,
    Json(body): Json<ChoiceBody>,
) -> Result<Resource<Clip>, Error> {
    let chosen = chosen(&body)?;
    to_the_end(async move {
        let is_expected = is_expected::<Clip, viola_storage::Clip>(headers);
        let clip = app.storage.choose(&home, clip, chosen, is_expected, app.storage.now()).await?;
        app.queue.wake();
        Ok(Resource(clip.into()))
    })
    .await
}

/// Withdraw a choice
///
/// The clip returns to the method's own verdict. Without a choice, nothing changes.
#[utoipa::path(delete, path = "/v1/homes/{home}/clips/{clip}/alignment", tag = "clips",
    params(ClipPath, ("If-Match" = Option<String>, Header, description = "The `ETag` of the clip as it was read")),
    responses((status = 200, description = "The clip without a choice", body = Clip,
            headers(("ETag" = String, description = "For `If-Match` of the next change"))),
        ChangedClip, CommonProblems))]
pub(super) async fn withdraw_alignment(
    State(app): State<App>,
    ClipPath { home, clip }: ClipPath,
    headers: HeaderMap,
) -> Result<Resource<Clip>, Error> {
    to_the_end(async move {
        let is_expected = is_expected::<Clip, viola_storage::Clip>(headers);
        let clip = app.storage.withdraw_choice(&home, clip, is_expected, app.storage.now()).await?;
        app.queue.wake();
        Ok(Resource(clip.into()))
    })
    .await
}

fn chosen(body: &ChoiceBody) -> Result<Chosen, Error> {
    let level = match &body.level {
        None => LevelName::MAIN,
        Some(_) if body.map_from_clip.is_none() => {
            return Err(wrong("level", "given with map_from_clip only"));
        }
        Some(name) => {
            let level = name.as_str().and_then(|name| name.parse().ok());
            level.ok_or_else(|| wrong("level", "1 to 32 characters of a-z 0-9 _ -"))?
        }
    };
    match (&body.alternative, &body.map_from_clip) {
        (Some(index), None) => {
            let index = index.as_ref().and_then(Value::as_u64);
            index.map(Chosen::Alternative).ok_or_else(|| wrong("alternative", "an index from 0"))
        }
        (None, Some(Some(Value::Object(members)))) => {
            if let Some(other) =
                members.keys().find(|name| !["x_m", "y_m", "yaw_rad"].contains(&name.as_str()))
            {
                let detail = format!("map_from_clip has the members x_m, y_m and yaw_rad, and not {other}");
                return Err(Error::InvalidBody { field: Some("map_from_clip".into()), detail });
            }
            let number = |name: &str, field, what| {
                let number = members.get(name).and_then(Value::as_f64).filter(|number| number.is_finite());
                number.ok_or_else(|| wrong(field, what))
            };
            let x_m = number("x_m", "map_from_clip.x_m", "a number of metres")?;
            let y_m = number("y_m", "map_from_clip.y_m", "a number of metres")?;
            let yaw_rad = number("yaw_rad", "map_from_clip.yaw_rad", "a number of radians")?;
            if yaw_rad.abs() > MAX_YAW_RAD {
                return Err(wrong("map_from_clip.yaw_rad", "in radians, within a whole turn to each side"));
            }
            Ok(Chosen::Pose(level, Pose2 { x_m, y_m, yaw_rad }))
        }
        (None, Some(_)) => Err(wrong("map_from_clip", "an object of x_m, y_m and yaw_rad")),
        _ => {
            let detail = "give one of alternative and map_from_clip, and not both".to_owned();
            Err(Error::InvalidBody { field: None, detail })
        }
    }
}

impl From<ChoiceError> for Error {
    fn from(error: ChoiceError) -> Error {
        let detail = error.to_string();
        let member = match error {
            ChoiceError::Storage(StorageError::NoLidarMap) => return Error::NothingToAlignTo,
            ChoiceError::Storage(error) => return error.into(),
            ChoiceError::NoAnswerYet(_) => return Error::NoAnswerYet(detail),
            ChoiceError::NoSuchLevel(_) => "level",
            ChoiceError::NoSuchAlternative { .. } => "alternative",
            ChoiceError::OutOfReach { field, .. } => field,
        };
        Error::InvalidBody { field: Some(member.into()), detail }
    }
}
