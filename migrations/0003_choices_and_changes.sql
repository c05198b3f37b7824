-- choice: the pose that a person gave; it stands beside the method's own answer (alignment) until it is withdrawn.
-- placement: where the newest revision of the home's map has the clip.
-- recorded_at: when the clip was recorded, as its sender or its file says.
ALTER TABLE clips ADD COLUMN choice TEXT;
ALTER TABLE clips ADD COLUMN placement TEXT;
ALTER TABLE clips ADD COLUMN recorded_at BIGINT;

-- Lists are filtered within the index, so that only the rows of a page are read.
DROP INDEX clips_of_home;
CREATE INDEX clips_of_home ON clips (home_id, id, state, updated_at);
CREATE INDEX homes_by_update ON homes (updated_at, id);

-- The changes feed: the newest change of each home, LiDAR map, clip and fused map. No reference to homes, since what is
-- deleted is told for a time. clip_id is empty for what a home has one of; revision is that of the map.
CREATE TABLE changes (
    seq      BIGINT NOT NULL PRIMARY KEY,
    at       BIGINT NOT NULL,
    home_id  TEXT   NOT NULL,
    kind     TEXT   NOT NULL,
    clip_id  TEXT   NOT NULL,
    revision BIGINT,
    state    TEXT,
    deleted  BIGINT NOT NULL,
    UNIQUE (home_id, kind, clip_id)
);
CREATE INDEX changes_deleted ON changes (at) WHERE deleted = 1;

-- What was there before the feed is told as if it had changed now.
INSERT INTO changes (seq, at, home_id, kind, clip_id, revision, state, deleted)
SELECT ROW_NUMBER() OVER (ORDER BY rank, at, home_id, clip_id), at, home_id, kind, clip_id, revision, state, 0
FROM (
    SELECT 1 AS rank, updated_at AS at, id AS home_id, 'home' AS kind, '' AS clip_id, NULL AS revision, NULL AS state
    FROM homes
    UNION ALL
    SELECT 2, MAX(created_at), home_id, 'lidar_map', '', MAX(revision), NULL FROM lidar_maps GROUP BY home_id
    UNION ALL
    SELECT 3, updated_at, home_id, 'clip', id, NULL, state FROM clips
    UNION ALL
    SELECT 4, MAX(created_at), home_id, 'map', '', MAX(revision), NULL FROM home_maps GROUP BY home_id
) AS existing;

-- The last number given out. It is kept apart, since the row that had it may have been removed.
CREATE TABLE change_counter (last_seq BIGINT NOT NULL);
INSERT INTO change_counter (last_seq) SELECT COUNT(*) FROM changes;
