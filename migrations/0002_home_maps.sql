-- A home's fused map. map_wanted grows with every change of the set of aligned clips; a home whose map_made is behind
-- it is due for a merge, which one worker at a time does under a lease, as with jobs.
ALTER TABLE homes ADD COLUMN map_wanted BIGINT NOT NULL DEFAULT 0;
ALTER TABLE homes ADD COLUMN map_made BIGINT NOT NULL DEFAULT 0;
ALTER TABLE homes ADD COLUMN map_fence BIGINT NOT NULL DEFAULT 0;
ALTER TABLE homes ADD COLUMN map_lease_until BIGINT;

-- Every merge is one revision that never changes; the newest few are kept.
CREATE TABLE home_maps (
    home_id            TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    revision           BIGINT NOT NULL,
    lidar_map_revision BIGINT NOT NULL,
    clips              TEXT   NOT NULL,
    info               TEXT   NOT NULL,
    blob_key           TEXT   NOT NULL,
    created_at         BIGINT NOT NULL,
    PRIMARY KEY (home_id, revision)
);

-- What was aligned before there were maps is merged now.
UPDATE homes SET map_wanted = 1 WHERE id IN (SELECT home_id FROM clips WHERE state = 'aligned');
