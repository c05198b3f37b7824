-- Finds whether a home has a clip that is queued or running: its map waits for it. Without this index SQLite reads the rows of all
-- clips of the home.
CREATE INDEX clips_unsettled ON clips (home_id, state, job_id) WHERE state IN ('queued', 'aligning');
