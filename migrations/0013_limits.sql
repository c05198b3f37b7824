-- Limits of a tenant in place of the service's; null: the service's.
CREATE TABLE tenant_limits (
    tenant      TEXT   NOT NULL PRIMARY KEY,
    max_bytes   BIGINT,
    max_uploads BIGINT
);

-- Sizes of the files that jobs and merges make, and of the pictures of LiDAR maps; 0 for files of earlier versions.
ALTER TABLE clips ADD COLUMN result_bytes BIGINT NOT NULL DEFAULT 0;
ALTER TABLE lidar_maps ADD COLUMN image_bytes BIGINT NOT NULL DEFAULT 0;
ALTER TABLE home_map_files ADD COLUMN size_bytes BIGINT NOT NULL DEFAULT 0;
