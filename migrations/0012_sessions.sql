-- Sessions of browsers. A session has the rights of its key; only the SHA-256 of its token is stored.
CREATE TABLE sessions (
    sha256     TEXT   NOT NULL PRIMARY KEY,
    key_id     TEXT   NOT NULL REFERENCES api_keys (id) ON DELETE CASCADE,
    created_at BIGINT NOT NULL,
    expires_at BIGINT NOT NULL
);
CREATE INDEX sessions_of_key ON sessions (key_id, created_at);
CREATE INDEX sessions_by_end ON sessions (expires_at);
