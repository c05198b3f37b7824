-- content_sha256: the SHA-256 of the files in a clip's archive; other archives of the same files have the same. Null for a clip
-- of one file, and for clips of earlier versions.
ALTER TABLE clips ADD COLUMN content_sha256 TEXT;

-- Finds the clips of a home with the same content.
CREATE INDEX clips_by_content ON clips (home_id, content_sha256, id) WHERE content_sha256 IS NOT NULL;
