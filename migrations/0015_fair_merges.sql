-- Homes whose map is behind: tenants take turns, and of a tenant the home that was merged longest ago comes first.
ALTER TABLE homes ADD COLUMN map_claimed_at BIGINT NOT NULL DEFAULT 0;
DROP INDEX homes_due;
CREATE INDEX homes_due ON homes (tenant, map_claimed_at, id) WHERE map_made < map_wanted;
