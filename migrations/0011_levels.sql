-- A home may have several LiDAR maps, one for each level. Revisions count the files of a home over all its levels; the
-- highest revision of a level is its current map.
ALTER TABLE lidar_maps ADD COLUMN level TEXT NOT NULL DEFAULT 'main';
-- The files of a removed level are gone; its rows stay, since revisions count them and jobs name them.
ALTER TABLE lidar_maps ADD COLUMN removed_at BIGINT;

-- The LiDAR map of each level in a revision of the home's map; null in revisions of earlier versions, which have one level.
ALTER TABLE home_maps ADD COLUMN levels TEXT;

-- Each level has its own tiles, scene and plan. The manifest belongs to all levels and has level 'main'.
ALTER TABLE home_map_files ADD COLUMN level TEXT NOT NULL DEFAULT 'main';
