-- Each start of a process begins an epoch of the changes feed after the numbers assigned so far. The first one has the cursors
-- that name none.
CREATE TABLE feed_epochs (
    number BIGINT PRIMARY KEY,
    id TEXT NOT NULL,
    from_seq BIGINT NOT NULL,
    begun_at BIGINT NOT NULL
);
INSERT INTO feed_epochs (number, id, from_seq, begun_at) VALUES (0, '00000000-0000-0000-0000-000000000000', 0, 0);
