-- Faults of the service are not held against a job. faults: attempts in a row that ended by a fault of the storage or of
-- the machine, or whose worker was lost. first_fault_at: when that row of faults began; null without one. suspect: 1
-- once a worker was lost with the job; it then runs in a process of its own.
ALTER TABLE jobs ADD COLUMN faults BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN first_fault_at BIGINT;
ALTER TABLE jobs ADD COLUMN suspect BIGINT NOT NULL DEFAULT 0;
