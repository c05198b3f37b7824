-- Merges of a home that failed or lost their worker, since the last one that ended, and the time before which no further one begins.
ALTER TABLE homes ADD COLUMN map_faults BIGINT NOT NULL DEFAULT 0;
ALTER TABLE homes ADD COLUMN map_due_at BIGINT NOT NULL DEFAULT 0;
-- Finds the merges whose worker was lost.
CREATE INDEX homes_merging ON homes (map_lease_until) WHERE map_lease_until IS NOT NULL;

-- LOWER lowers letters of ASCII only; a process fills in an empty text when it starts.
UPDATE homes SET search = '' WHERE OCTET_LENGTH(search) <> LENGTH(search);
CREATE INDEX homes_without_search ON homes (id) WHERE search = '';
