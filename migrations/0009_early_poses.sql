-- early_pose: JSON of a running job's pose that is known before its labels; null while there is none and after the job.
ALTER TABLE jobs ADD COLUMN early_pose TEXT;
