//! Clips of one recording.

/// The oldest clip of the home with the same file or content; null for that clip.
macro_rules! duplicate_of {
    () => {
        // Each of the two has an index; with OR, every older clip of the home would be read.
        "(SELECT MIN(twins.id) FROM (
            SELECT MIN(same.id) AS id FROM clips AS same
            WHERE same.home_id = clips.home_id AND same.sha256 = clips.sha256 AND same.id < clips.id
            UNION ALL SELECT MIN(same.id) FROM clips AS same
            WHERE same.home_id = clips.home_id AND same.content_sha256 = clips.content_sha256 AND same.id < clips.id
        ) AS twins) AS duplicate_of"
    };
}
pub(super) use duplicate_of;
