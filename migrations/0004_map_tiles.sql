-- A home's map is kept in tiles, so that a new clip rewrites the places that it saw and no others.
DROP TABLE home_maps;

-- Every merge is one revision that never changes; the newest few are kept.
CREATE TABLE home_maps (
    home_id            TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    revision           BIGINT NOT NULL,
    lidar_map_revision BIGINT NOT NULL,
    clips              TEXT   NOT NULL,
    info               TEXT   NOT NULL,
    created_at         BIGINT NOT NULL,
    PRIMARY KEY (home_id, revision)
);

-- The files of a map: each belongs to the revisions from first_revision to last_revision, both of them included; the
-- last is null while it is current. tile_x and tile_y say which tile it is, and are null for the others.
CREATE TABLE home_map_files (
    blob_key       TEXT   NOT NULL PRIMARY KEY,
    home_id        TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    name           TEXT   NOT NULL,
    tile_x         BIGINT,
    tile_y         BIGINT,
    first_revision BIGINT NOT NULL,
    last_revision  BIGINT
);
CREATE INDEX home_map_files_of_home ON home_map_files (home_id, name, tile_x, tile_y);

-- The objects of the current revisions.
CREATE TABLE home_objects (
    home_id   TEXT NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    object_id TEXT NOT NULL,
    class     TEXT NOT NULL,
    document  TEXT NOT NULL,
    PRIMARY KEY (home_id, object_id)
);
CREATE INDEX home_objects_by_class ON home_objects (class, home_id, object_id);

-- Results of before lack what a map is made of now.
UPDATE clips SET state = 'uploaded', alignment = NULL, result_key = NULL,
    reasons = '[{"code":"aligned_by_earlier_version","detail":"align the clip again: an earlier version aligned it"}]'
WHERE result_key IS NOT NULL;
UPDATE homes SET map_wanted = map_wanted + 1 WHERE map_wanted > 0;
