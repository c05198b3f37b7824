-- map_faults: merges without a result since the last one with a result. map_due_at: time of the next attempt.
ALTER TABLE homes ADD COLUMN map_faults BIGINT NOT NULL DEFAULT 0;
ALTER TABLE homes ADD COLUMN map_due_at BIGINT NOT NULL DEFAULT 0;
-- Finds the merges whose worker was lost.
CREATE INDEX homes_merging ON homes (map_lease_until) WHERE map_lease_until IS NOT NULL;

-- LOWER lowers letters of ASCII only; a process fills in an empty text when it starts.
UPDATE homes SET search = '' WHERE OCTET_LENGTH(search) <> LENGTH(search);
CREATE INDEX homes_without_search ON homes (id) WHERE search = '';
