-- Many processes on PostgreSQL: nothing that every writer must wait for, and jobs in a fair order.

-- Whose a home is. Tables know a home of another tenant than 'default' as tenant/id, so that two tenants may use the
-- same id; ids have no slash.
ALTER TABLE homes ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
DROP INDEX homes_by_update;
CREATE INDEX homes_of_tenant ON homes (tenant, id);
CREATE INDEX homes_by_update ON homes (tenant, updated_at, id);
ALTER TABLE home_objects ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
DROP INDEX home_objects_by_class;
CREATE INDEX home_objects_by_class ON home_objects (tenant, class, home_id, object_id);
CREATE INDEX home_objects_of_tenant ON home_objects (tenant, home_id, object_id);
ALTER TABLE uploads ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
CREATE INDEX uploads_of_tenant ON uploads (tenant, state);

-- The changes feed is numbered by who reads it, and not by who writes: seq is null until then, and
-- null again when the thing has changed anew. ticket is the order in which changes without a number are numbered. at
-- never goes back.
CREATE TABLE new_changes (
    home_id  TEXT   NOT NULL,
    kind     TEXT   NOT NULL,
    clip_id  TEXT   NOT NULL,
    tenant   TEXT   NOT NULL DEFAULT 'default',
    at       BIGINT NOT NULL,
    revision BIGINT,
    state    TEXT,
    deleted  BIGINT NOT NULL,
    ticket   TEXT   NOT NULL DEFAULT '',
    seq      BIGINT,
    PRIMARY KEY (home_id, kind, clip_id)
);
INSERT INTO new_changes (home_id, kind, clip_id, at, revision, state, deleted, seq)
SELECT home_id, kind, clip_id, at, revision, state, deleted, seq FROM changes;
DROP TABLE changes;
ALTER TABLE new_changes RENAME TO changes;
CREATE UNIQUE INDEX changes_by_seq ON changes (seq);
CREATE INDEX changes_of_tenant ON changes (tenant, seq);
CREATE INDEX changes_without_seq ON changes (ticket) WHERE seq IS NULL;
CREATE INDEX changes_by_time ON changes (tenant, at, home_id);
CREATE INDEX changes_deleted ON changes (at) WHERE deleted = 1;

-- tenant: whose home a job is for, to share the workers fairly. position: how many jobs of its home were unfinished
-- when it was queued. order_at: when its turn is; what a home or a tenant has queued already moves it back.
ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
ALTER TABLE jobs ADD COLUMN position BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN order_at BIGINT NOT NULL DEFAULT 0;
UPDATE jobs SET order_at = run_after;
DROP INDEX jobs_by_state;
CREATE INDEX jobs_in_turn ON jobs (order_at, id) WHERE state = 'queued';
CREATE INDEX jobs_by_lease ON jobs (lease_until) WHERE state = 'running';
CREATE INDEX jobs_of_tenant ON jobs (tenant, position) WHERE state IN ('queued', 'running');

-- Homes whose map is behind.
CREATE INDEX homes_due ON homes (id) WHERE map_made < map_wanted;

-- Who may call. The secret itself is kept nowhere; home_id is null where the key is for all homes of its tenant.
CREATE TABLE api_keys (
    id           TEXT   NOT NULL PRIMARY KEY,
    tenant       TEXT   NOT NULL,
    role         TEXT   NOT NULL,
    home_id      TEXT,
    label        TEXT   NOT NULL,
    sha256       TEXT   NOT NULL UNIQUE,
    created_at   BIGINT NOT NULL,
    expires_at   BIGINT,
    revoked_at   BIGINT,
    last_used_at BIGINT
);
CREATE INDEX api_keys_of_tenant ON api_keys (tenant, id);

-- What a home's clips and LiDAR maps were as files, to bound what a tenant may keep.
ALTER TABLE homes ADD COLUMN size_bytes BIGINT NOT NULL DEFAULT 0;
UPDATE homes SET size_bytes =
    COALESCE((SELECT CAST(SUM(clips.size_bytes) AS BIGINT) FROM clips WHERE clips.home_id = homes.id), 0)
    + COALESCE((SELECT CAST(SUM(lidar_maps.size_bytes) AS BIGINT) FROM lidar_maps WHERE lidar_maps.home_id = homes.id), 0);

-- By which a sweep finds whether a blob is named.
CREATE INDEX upload_pieces_by_blob ON upload_pieces (blob_key);
