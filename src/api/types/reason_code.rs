//! The codes of reasons, with advice for people.

use serde_json::json;
use utoipa::openapi::extensions::ExtensionsBuilder;
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

/// The codes of the method and the service with the advice of docs/api.md, in its order.
#[rustfmt::skip]
const REASONS: [(&str, &str); 53] = [
    ("no_lidar_map", "send the home's LiDAR map"),
    ("cancelled", "align the clip again"),
    ("superseded", "none; a newer job aligns the clip"),
    ("storage_fault", "repair the service; align a failed clip again"),
    ("system_fault", "repair the service; align a failed clip again"),
    ("worker_lost", "repair the service; align a failed clip again"),
    ("internal_error", "read the log of the service"),
    ("storage_error", "read the log of the service"),
    ("worker_died", "give the worker more memory, or record a shorter clip"),
    ("took_too_long", "record a shorter clip, or raise `--job-seconds` or `--job-memory-mb`"),
    ("too_large", "record a shorter clip, or raise `--job-seconds` or `--job-memory-mb`"),
    ("unreadable", "send the file again"),
    ("no_frame_in_range", "ask for frames that the clip has (`--frames`)"),
    ("no_posed_frame", "record with an app that stores poses"),
    ("clip_extent_too_large", "check that the poses are in metres, or split the recording into several clips"),
    ("nothing_fused", "stay between 0.5 and 4 m from surfaces (depth from 0.15 to 5 m is used)"),
    ("frames_broken", "none; the frames are left out"),
    ("clip_too_large", "record a shorter clip; some surface is left out"),
    ("no_colour", "record with colour for classes by pictures"),
    ("tracked", "record with an app that stores poses"),
    ("sparse_frames", "record at 10 frames a second or more"),
    ("track_failed", "move slowly, or record with an app that stores poses"),
    ("track_no_depth", "stay between 0.5 and 4 m from surfaces (depth from 0.15 to 5 m is used); avoid glass"),
    ("track_dark", "switch on the light"),
    ("track_unconstrained", "avoid frames that show only a bare wall or floor"),
    ("track_jump", "move slowly, and send recordings without cuts"),
    ("frames_without_pose", "check that the recording of the poses was not cut off"),
    ("poses_disagree", "check that the poses are world from camera, in metres, with x right, y down and z forward"),
    ("poses_dropped", "none; the outliers are left out, the drift is refined"),
    ("poses_refined", "none; the outliers are left out, the drift is refined"),
    ("no_floor", "include some floor in the recording"),
    ("up_unknown", "hold the phone upright and include some floor, or record with an app that stores gravity"),
    ("floor_assumed", "include some floor in the recording"),
    ("scale_unknown", "include some floor, or record with a phone that measures depth"),
    ("several_scales", "film more of the room, or record with a phone that measures depth"),
    ("scale_disagrees", "check the unit of the depth and the size of the map's cells, or film more of the room"),
    ("map_empty", "send a LiDAR map that has walls"),
    ("too_few_hits", "film more of the room, and its lower half"),
    ("no_candidate", "check that the LiDAR map is of this home"),
    ("search_incomplete", "choose an alternative, or film more of the room"),
    ("no_support", "check that the LiDAR map is of this home"),
    ("several_modes", "choose an alternative, or film more of the room"),
    ("weak_evidence", "film more of the room, and its lower half"),
    ("not_this_home", "check the home of the clip; send a LiDAR map of all rooms"),
    ("network_unavailable", "check the models folder and the log of the service"),
    ("network_failed", "check the models folder and the log of the service"),
    ("imagination_failed", "check the models folder and the log of the service"),
    ("decided_by_neighbours", "none"),
    ("chosen_by_person", "none"),
    ("choice_carried_over", "look at the clip"),
    ("choice_of_earlier_lidar_map", "look at the clip; choose again, or withdraw the choice"),
    ("choice_without_result", "align the clip again; the choice then holds"),
    ("results_damaged", "align the clip again, or restore its files"),
];

/// The codes of the readers of clips and LiDAR maps, in order: a file whose damage shows only when a job reads it.
#[rustfmt::skip]
pub(in crate::api) const READERS: [&str; 84] = [
    "archive_bomb", "bad_compression", "bad_depth", "bad_field", "bad_image", "bad_index", "bad_intrinsics",
    "bad_json", "bad_log", "bad_metadata", "bad_pcd", "bad_picture", "bad_ply", "bad_points", "bad_robot_map",
    "bad_video", "bad_yaml", "cannot_unpack", "color_depth_mismatch", "depth_not_grey16", "depth_video",
    "duplicate_frame", "duplicate_name", "empty", "file_too_large", "frames_not_ascending", "image_size_changed",
    "image_without_yaml", "link", "map_far_from_origin", "map_too_large", "missing_file", "missing_intrinsics",
    "no_frames", "no_such_frame", "no_video_track", "no_walls", "not_an_archive", "not_metric", "not_video",
    "packing_damaged", "packing_pieces", "packing_truncated", "partial_map", "path_escapes", "picture_too_large",
    "several_clips", "several_trajectories", "tar_damaged", "tar_sparse", "tar_special_file", "tar_truncated",
    "three_dimensional_map", "too_many_cells", "too_many_entries", "too_many_frames", "too_many_points",
    "unknown_format", "unknown_layout", "unpacks_too_large", "video_broke_decoder", "video_changes",
    "video_child_ended", "video_child_lied", "video_child_silent", "video_child_start", "video_child_stopped",
    "video_codec", "video_damaged", "video_edit_list", "video_encrypted", "video_ended", "video_fragmented",
    "video_size", "video_too_large", "video_truncated", "video_unsupported", "yaml_without_image", "zip_bomb",
    "zip_damaged", "zip_encrypted", "zip_method", "zip_truncated", "zstd_window",
];

/// Codes that only clips of earlier versions have.
const EARLIER: [&str; 1] = ["aligned_by_earlier_version"];

/// The code of a reason.
pub(in crate::api) struct ReasonCode;

impl ReasonCode {
    /// Returns whether a clip of this or an earlier version may have a reason with this code.
    pub fn is_known(code: &str) -> bool {
        ReasonCode::all().any(|known| known == code)
    }

    fn all() -> impl Iterator<Item = &'static str> {
        REASONS.iter().map(|(code, _)| *code).chain(READERS).chain(EARLIER)
    }
}

impl PartialSchema for ReasonCode {
    fn schema() -> RefOr<Schema> {
        let lines: Vec<String> =
            REASONS.iter().map(|(code, advice)| format!("- `{code}`: {advice}")).collect();
        let description = format!(
            "Stable, in snake case, for programs. Later versions may have more codes. The advice for people:\n{}\n\nThe \
             other codes are those of the readers of files. Such a file is damaged, or not of a known kind: export the \
             recording again, and send it.",
            lines.join("\n")
        );
        let advice = REASONS.iter().map(|(code, advice)| ((*code).to_owned(), json!(advice)));
        let advice = serde_json::Value::Object(advice.collect());
        ObjectBuilder::new()
            .schema_type(Type::String)
            .description(Some(description))
            .enum_values(Some(ReasonCode::all()))
            .examples(["several_modes"])
            .extensions(Some(ExtensionsBuilder::new().add("x-advice", advice).build()))
            .into()
    }
}

impl ToSchema for ReasonCode {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The sources of the readers' errors.
    const SOURCES: [&str; 4] = [
        include_str!("../../../crates/viola-formats/src/clip/error.rs"),
        include_str!("../../../crates/viola-formats/src/container/error.rs"),
        include_str!("../../../crates/viola-formats/src/lidar/error.rs"),
        include_str!("../../../crates/viola-formats/src/video/error.rs"),
    ];

    #[test]
    fn every_code_of_a_reader_is_known() {
        let mut found = BTreeSet::new();
        for source in SOURCES {
            for rest in source.split("=> ").skip(1) {
                let quoted = rest.trim_start_matches(['{', ' ', '\n']).strip_prefix('"');
                found.extend(quoted.and_then(|rest| rest.split_once('"')).map(|(code, _)| code));
            }
        }
        assert!(found.len() > 80, "{found:?}");
        let of_table: BTreeSet<&str> = REASONS.iter().map(|(code, _)| *code).collect();
        let others: BTreeSet<&str> = found.difference(&of_table).copied().collect();
        assert_eq!(others, READERS.into_iter().collect());
        let all: Vec<&str> = ReasonCode::all().collect();
        assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len(), "a code is twice in the lists");
    }
}
