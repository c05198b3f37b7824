-- Files that arrive in parts (tus 1.0). Bytes that were acknowledged lie in upload_pieces, whose blobs never change; an
-- upload grows by a new piece only where it was as long as the writer thought, and under the fence that the writer took
-- when it began. So no lock is held while a phone sends, and a writer that was overtaken changes nothing.
-- kind: whole; partial (to be joined with others); final (joined of partial ones).
-- state: arriving; arrived (every byte is here); joined (a partial one that a final one took over); finished (it is a
-- clip); refused (it cannot become one; problem says why).
-- lease_until and attempts belong to who makes the clip: attempts counts those that were never heard of again.
CREATE TABLE uploads (
    id             TEXT   NOT NULL PRIMARY KEY,
    home_id        TEXT   REFERENCES homes (id) ON DELETE CASCADE,
    clip_id        TEXT   REFERENCES clips (id) ON DELETE CASCADE,
    joined_into    TEXT,
    kind           TEXT   NOT NULL,
    state          TEXT   NOT NULL,
    metadata       TEXT   NOT NULL,
    concat         TEXT,
    length_bytes   BIGINT,
    received_bytes BIGINT NOT NULL,
    pieces         BIGINT NOT NULL,
    fence          BIGINT NOT NULL,
    lease_until    BIGINT,
    attempts       BIGINT NOT NULL,
    problem        TEXT,
    created_at     BIGINT NOT NULL,
    expires_at     BIGINT NOT NULL
);
CREATE INDEX uploads_of_home ON uploads (home_id, state);
CREATE INDEX uploads_of_clip ON uploads (clip_id);
CREATE INDEX uploads_by_state ON uploads (state, expires_at);

CREATE TABLE upload_pieces (
    upload_id  TEXT   NOT NULL REFERENCES uploads (id) ON DELETE CASCADE,
    first_byte BIGINT NOT NULL,
    size_bytes BIGINT NOT NULL,
    blob_key   TEXT   NOT NULL,
    PRIMARY KEY (upload_id, first_byte)
);
