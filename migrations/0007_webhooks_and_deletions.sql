-- Addresses that are told what changed. seq: how far the feed has been turned into deliveries. lease_until: until when
-- a process is sending to it; between two, when the last one let go, so that all have their turns.
CREATE TABLE webhooks (
    id          TEXT   NOT NULL PRIMARY KEY,
    tenant      TEXT   NOT NULL,
    url         TEXT   NOT NULL,
    kinds       TEXT   NOT NULL,
    secret      TEXT   NOT NULL,
    seq         BIGINT NOT NULL,
    created_at  BIGINT NOT NULL,
    disabled_at BIGINT,
    lease_until BIGINT NOT NULL DEFAULT 0,
    fence       BIGINT NOT NULL DEFAULT 0
);
CREATE INDEX webhooks_of_tenant ON webhooks (tenant, id);

-- What is to be told, and what was; the log of the ended ones is kept for a while.
CREATE TABLE webhook_deliveries (
    id         TEXT   NOT NULL PRIMARY KEY,
    webhook_id TEXT   NOT NULL REFERENCES webhooks (id) ON DELETE CASCADE,
    event      TEXT   NOT NULL,
    body       TEXT   NOT NULL,
    state      TEXT   NOT NULL,
    attempts   BIGINT NOT NULL DEFAULT 0,
    due_at     BIGINT NOT NULL,
    status     BIGINT,
    error      TEXT,
    created_at BIGINT NOT NULL,
    updated_at BIGINT NOT NULL
);
CREATE INDEX webhook_deliveries_of_webhook ON webhook_deliveries (webhook_id, id);
CREATE INDEX webhook_deliveries_due ON webhook_deliveries (webhook_id, due_at) WHERE state = 'pending';
CREATE INDEX webhook_deliveries_ended ON webhook_deliveries (updated_at) WHERE state <> 'pending';

-- Blobs of what was deleted, until they are gone. blob_keys is a JSON list.
CREATE TABLE doomed_blobs (
    id         TEXT   NOT NULL PRIMARY KEY,
    owner      TEXT   NOT NULL,
    blob_keys  TEXT   NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX doomed_blobs_by_owner ON doomed_blobs (owner);

-- Lists of a tenant's jobs.
CREATE INDEX jobs_by_tenant ON jobs (tenant, state, id);

-- What a tenant's homes have as files, in several rows, so that its uploads do not wait for each other.
CREATE TABLE tenant_sizes (
    tenant     TEXT   NOT NULL,
    part       BIGINT NOT NULL,
    size_bytes BIGINT NOT NULL,
    PRIMARY KEY (tenant, part)
);
INSERT INTO tenant_sizes (tenant, part, size_bytes)
SELECT tenant, 0, CAST(SUM(size_bytes) AS BIGINT) FROM homes GROUP BY tenant;
