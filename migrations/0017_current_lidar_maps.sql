-- Finds the current LiDAR map of a level. The rows of removed maps stay, and a robot's map may change every day.
CREATE INDEX lidar_maps_current ON lidar_maps (home_id, level, revision) WHERE removed_at IS NULL;
