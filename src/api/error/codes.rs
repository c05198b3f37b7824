//! The codes of all problems, for the OpenAPI document.

use crate::api::types::READERS;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// The codes, with underscores, in order.
pub(in crate::api) static CODES: LazyLock<BTreeSet<&str>> =
    LazyLock::new(|| OWN.into_iter().chain(READERS).collect());

/// The codes that are not of readers of files. Each first letter begins a line.
#[rustfmt::skip]
const OWN: [&str; 67] = [
    "body_empty", "body_incomplete", "body_stalled", "body_too_large",
    "changed_meanwhile", "checksum_mismatch", "clip_not_found", "cursor_expired",
    "delivery_not_found", "digest_mismatch",
    "forbidden", "foreign_host", "foreign_origin",
    "home_not_found",
    "idempotency_key_reused", "internal_error", "invalid_body", "invalid_header", "invalid_path",
    "invalid_query",
    "job_ended", "job_not_found",
    "key_invalid", "key_missing",
    "last_level", "lidar_map_not_found",
    "makers_busy", "malformed_json", "map_not_found", "map_revision_removed", "method_not_allowed",
    "no_answer_yet", "no_lidar_map", "no_thumbnail", "not_ready",
    "object_not_found",
    "range_not_satisfiable", "readers_busy", "result_not_found", "room_not_found", "route_not_found",
    "session_ended", "stopping", "storage_full",
    "tenant_full", "too_many_corrections", "too_many_exports", "too_many_failed_keys", "too_many_levels",
    "too_many_pieces", "too_many_requests", "too_many_uploads", "too_many_webhooks", "took_too_long",
    "tus_version_unsupported",
    "unavailable", "unknown_checksum_algorithm", "unreadable", "unsupported_media_type", "upload_final",
    "upload_gone", "upload_lost", "upload_not_found", "upload_offset_mismatch", "upload_unfinished",
    "upload_unreadable",
    "webhook_not_found",
];

#[cfg(test)]
mod tests {
    use super::CODES;
    use std::collections::BTreeSet;

    /// The sources that map errors to codes, and the text before a code in them.
    const SOURCES: [(&str, &[&str]); 9] = [
        (include_str!("../error.rs"), &["S::", "(status, "]),
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
        assert_eq!(found, CODES.iter().map(|code| (*code).to_owned()).collect::<BTreeSet<String>>());
    }
}
