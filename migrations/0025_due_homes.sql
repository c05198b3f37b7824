-- Time of the first change that the newest map of a home lacks; null in rows of earlier versions. It counts only while map_made is
-- behind map_wanted.
ALTER TABLE homes ADD COLUMN map_due_since BIGINT;

-- Finds whether a home has a clip that is queued or running, and in its newest map.
CREATE INDEX clips_unsettled_in_map ON clips (home_id, state, job_id, placement)
    WHERE state IN ('queued', 'aligning') AND placement IS NOT NULL;
