-- The last answer of a clip, from when its next job is queued until a job gives another one: the alignment, the key and size
-- of its files, and the revision of the LiDAR maps that it is of.
ALTER TABLE clips ADD COLUMN last_alignment TEXT;
ALTER TABLE clips ADD COLUMN last_result_key TEXT;
ALTER TABLE clips ADD COLUMN last_result_bytes BIGINT NOT NULL DEFAULT 0;
ALTER TABLE clips ADD COLUMN last_lidar_map_revision BIGINT;
CREATE INDEX clips_by_last_result ON clips (last_result_key) WHERE last_result_key IS NOT NULL;

-- again: 1 for a job that aligns a clip with an answer to a new LiDAR map; clips without an answer come before it.
ALTER TABLE jobs ADD COLUMN again BIGINT NOT NULL DEFAULT 0;
CREATE INDEX jobs_of_new_clips ON jobs (tenant, position) WHERE again = 0 AND state IN ('queued', 'running');
CREATE INDEX jobs_of_new_clips_in_turn ON jobs (order_at) WHERE again = 0 AND state = 'queued';

-- content_key: the SHA-256 of the whole file, if its sender gave it, with the idempotency key, if there is one. A repeated
-- request finds the upload by it.
ALTER TABLE uploads ADD COLUMN content_key TEXT;
CREATE INDEX uploads_by_content ON uploads (home_id, content_key) WHERE content_key IS NOT NULL;
