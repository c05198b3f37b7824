-- Runs on SQLite and on PostgreSQL: ids are text, times are milliseconds since 1970, documents are JSON text.

CREATE TABLE homes (
    id         TEXT   NOT NULL PRIMARY KEY,
    name       TEXT,
    created_at BIGINT NOT NULL,
    updated_at BIGINT NOT NULL
);

-- Every file that was put is one revision; the highest is the current one.
CREATE TABLE lidar_maps (
    id         TEXT   NOT NULL PRIMARY KEY,
    home_id    TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    revision   BIGINT NOT NULL,
    size_bytes BIGINT NOT NULL,
    sha256     TEXT   NOT NULL,
    info       TEXT   NOT NULL,
    created_at BIGINT NOT NULL,
    UNIQUE (home_id, revision)
);

-- alignment and result_key are set together, by the job that ran to an answer.
CREATE TABLE clips (
    id         TEXT   NOT NULL PRIMARY KEY,
    home_id    TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    size_bytes BIGINT NOT NULL,
    sha256     TEXT   NOT NULL,
    info       TEXT   NOT NULL,
    state      TEXT   NOT NULL,
    reasons    TEXT   NOT NULL,
    alignment  TEXT,
    result_key TEXT,
    job_id     TEXT,
    created_at BIGINT NOT NULL,
    updated_at BIGINT NOT NULL
);
CREATE INDEX clips_of_home ON clips (home_id, id);
CREATE INDEX clips_by_job ON clips (job_id);
CREATE INDEX clips_by_result ON clips (result_key);

-- fence grows with every claim: a worker whose fence is not the row's has lost the job.
-- version grows with every change: what a listener has seen.
CREATE TABLE jobs (
    id           TEXT             NOT NULL PRIMARY KEY,
    clip_id      TEXT             NOT NULL REFERENCES clips (id) ON DELETE CASCADE,
    lidar_map_id TEXT             NOT NULL REFERENCES lidar_maps (id) ON DELETE CASCADE,
    state        TEXT             NOT NULL,
    stage        TEXT,
    progress     DOUBLE PRECISION NOT NULL,
    attempts     BIGINT           NOT NULL,
    max_attempts BIGINT           NOT NULL,
    error        TEXT,
    run_after    BIGINT           NOT NULL,
    lease_until  BIGINT,
    fence        BIGINT           NOT NULL,
    version      BIGINT           NOT NULL,
    created_at   BIGINT           NOT NULL,
    updated_at   BIGINT           NOT NULL,
    started_at   BIGINT,
    finished_at  BIGINT
);
CREATE INDEX jobs_by_state ON jobs (state, run_after);
CREATE INDEX jobs_of_clip ON jobs (clip_id);
CREATE INDEX jobs_of_lidar_map ON jobs (lidar_map_id);

CREATE TABLE idempotency_keys (
    home_id         TEXT   NOT NULL REFERENCES homes (id) ON DELETE CASCADE,
    idempotency_key TEXT   NOT NULL,
    sha256          TEXT   NOT NULL,
    clip_id         TEXT   NOT NULL REFERENCES clips (id) ON DELETE CASCADE,
    created_at      BIGINT NOT NULL,
    PRIMARY KEY (home_id, idempotency_key)
);
CREATE INDEX idempotency_keys_of_clip ON idempotency_keys (clip_id);
