-- Corrections of people to objects and rooms of a home's map, apart from what the clips say. target is the id of the
-- object or room, document the correction; its places are in the frame of the LiDAR map of lidar_map_revision.
CREATE TABLE map_corrections (
    home_id            TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    kind               TEXT   NOT NULL,
    target             TEXT   NOT NULL,
    lidar_map_revision BIGINT NOT NULL,
    document           TEXT   NOT NULL,
    corrected_at       BIGINT NOT NULL,
    PRIMARY KEY (home_id, kind, target)
);

-- Grows with every correction, also one that is withdrawn: a merge sees by it whether the map has the present ones.
ALTER TABLE homes ADD COLUMN corrections BIGINT NOT NULL DEFAULT 0;
