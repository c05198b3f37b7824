-- Names that people gave: to the file of an upload, and to a clip.
ALTER TABLE clips ADD COLUMN title TEXT;
ALTER TABLE clips ADD COLUMN file_name TEXT;
ALTER TABLE lidar_maps ADD COLUMN file_name TEXT;
-- Finds the clips of a home with the same file.
CREATE INDEX clips_by_file ON clips (home_id, sha256, id);

-- The seen part of each level in the newest revision of the home's map; null before the first one with it.
ALTER TABLE homes ADD COLUMN coverage TEXT;
-- Id and name in lower case, for searches.
ALTER TABLE homes ADD COLUMN search TEXT NOT NULL DEFAULT '';
UPDATE homes SET search =
    LOWER(CASE WHEN tenant = 'default' THEN id ELSE SUBSTR(id, LENGTH(tenant) + 2) END || ' ' || COALESCE(name, ''));
