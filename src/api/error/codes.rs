//! The codes of all problems, for the OpenAPI document.

/// The codes, with underscores, in order. Each first letter begins a line.
#[rustfmt::skip]
pub(in crate::api) const CODES: [&str; 151] = [
    "archive_bomb",
    "bad_compression", "bad_depth", "bad_field", "bad_image", "bad_index", "bad_intrinsics", "bad_json",
    "bad_log", "bad_metadata", "bad_pcd", "bad_picture", "bad_ply", "bad_points", "bad_robot_map",
    "bad_video", "bad_yaml", "body_empty", "body_incomplete", "body_stalled", "body_too_large",
    "cannot_unpack", "changed_meanwhile", "checksum_mismatch", "clip_not_found", "color_depth_mismatch",
    "cursor_expired",
    "delivery_not_found", "depth_not_grey16", "depth_video", "digest_mismatch", "duplicate_frame",
    "duplicate_name",
    "empty",
    "file_too_large", "forbidden", "foreign_host", "foreign_origin", "frames_not_ascending",
    "home_not_found",
    "idempotency_key_reused", "image_size_changed", "image_without_yaml", "internal_error", "invalid_body",
    "invalid_header", "invalid_path", "invalid_query",
    "job_ended", "job_not_found",
    "key_invalid", "key_missing",
    "last_level", "lidar_map_not_found", "link",
    "makers_busy", "malformed_json", "map_far_from_origin", "map_not_found", "map_revision_removed",
    "map_too_large", "method_not_allowed", "missing_file", "missing_intrinsics",
    "no_answer_yet", "no_frames", "no_lidar_map", "no_such_frame", "no_thumbnail", "no_video_track",
    "no_walls", "not_an_archive", "not_metric", "not_ready", "not_video",
    "object_not_found",
    "packing_damaged", "packing_pieces", "packing_truncated", "partial_map", "path_escapes",
    "picture_too_large",
    "range_not_satisfiable", "readers_busy", "result_not_found", "room_not_found", "route_not_found",
    "session_ended", "several_clips", "several_trajectories", "stopping", "storage_full",
    "tar_damaged", "tar_sparse", "tar_special_file", "tar_truncated", "tenant_full", "three_dimensional_map",
    "too_many_cells", "too_many_corrections", "too_many_entries", "too_many_exports", "too_many_failed_keys",
    "too_many_frames", "too_many_levels", "too_many_pieces", "too_many_points", "too_many_requests",
    "too_many_uploads", "too_many_webhooks", "took_too_long", "tus_version_unsupported",
    "unavailable", "unknown_checksum_algorithm", "unknown_format", "unknown_layout", "unpacks_too_large",
    "unreadable", "unsupported_media_type", "upload_final", "upload_gone", "upload_lost", "upload_not_found",
    "upload_offset_mismatch", "upload_unfinished", "upload_unreadable",
    "video_broke_decoder", "video_changes", "video_child_ended", "video_child_lied", "video_child_silent",
    "video_child_start", "video_child_stopped", "video_codec", "video_damaged", "video_edit_list",
    "video_encrypted", "video_ended", "video_fragmented", "video_size", "video_too_large", "video_truncated",
    "video_unsupported",
    "webhook_not_found",
    "yaml_without_image",
    "zip_bomb", "zip_damaged", "zip_encrypted", "zip_method", "zip_truncated", "zstd_window",
];

#[cfg(test)]
mod tests {
    use super::CODES;
    use std::collections::BTreeSet;

    /// The sources that map errors to codes, and the text before a code in them.
    const SOURCES: [(&str, &[&str]); 10] = [
        (include_str!("../error.rs"), &["S::", "(status, "]),
        (include_str!("body.rs"), &["S::"]),
        (include_str!("correction.rs"), &["S::"]),
        (include_str!("defence.rs"), &["S::"]),
        (include_str!("storage.rs"), &["S::"]),
        (include_str!("../uploads/refusal.rs"), &["S::", "(status, "]),
        (include_str!("../../../crates/viola-formats/src/lidar/error.rs"), &["=> "]),
        (include_str!("../../../crates/viola-formats/src/clip/error.rs"), &["=> "]),
        (include_str!("../../../crates/viola-formats/src/container/error.rs"), &["=> "]),
        (include_str!("../../../crates/viola-formats/src/video/error.rs"), &["=> "]),
    ];

    /// Returns the code that follows a place in a source; `None` if another thing does.
    fn code(rest: &str) -> Option<&str> {
        let rest = rest.trim_start_matches(|c: char| c.is_ascii_uppercase() || c == '_');
        let (code, _) = rest.strip_prefix(", ").unwrap_or(rest).strip_prefix('"')?.split_once('"')?;
        let is_code =
            code.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_');
        is_code.then_some(code)
    }

    #[test]
    fn every_code_is_in_the_document() {
        let mut found = BTreeSet::new();
        for (source, marks) in SOURCES {
            let source = source.split_whitespace().collect::<Vec<_>>().join(" ");
            for mark in marks {
                let places = source.match_indices(mark).map(|(at, mark)| at + mark.len());
                found.extend(places.filter_map(|at| code(&source[at..])).map(str::to_owned));
            }
        }
        // An earlier refusal of the same file is repeated with its own code.
        found.remove("told");
        assert_eq!(found, CODES.map(str::to_owned).into());
    }
}
