-- The transform from the frame of the LiDAR map that a revision replaced, if the two maps tell it; JSON.
ALTER TABLE lidar_maps ADD COLUMN from_earlier TEXT;
