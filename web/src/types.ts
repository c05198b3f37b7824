// What the service answers, as far as the viewer reads it; the whole is in /openapi.json.

export interface Pose2 {
  x_m: number;
  y_m: number;
  yaw_rad: number;
}

export interface Reason {
  code: string;
  detail: string;
}

export interface List<T> {
  items: T[];
  next: string | null;
}

export interface Home {
  id: string;
  name: string | null;
  clips: number;
  lidar_map_revision: number | null;
  created_at: string;
  updated_at: string;
}

/** Where a picture lies in the map's frame, x right and y up. */
export interface PictureFrame {
  /** The upper left corner. */
  corner_m: [number, number];
  px_per_m: number;
  width_px: number;
  height_px: number;
}

export interface LidarMap {
  revision: number;
  size_bytes: number;
  created_at: string;
  image: PictureFrame;
  info: {
    format: string;
    frame: string;
    cell_m: number | null;
    occupied_points: number;
    free_area_m2: number;
    min_m: [number, number];
    max_m: [number, number];
    rooms: { id: string; name: string | null; area_m2: number; centre_m: [number, number] }[];
    charger: Pose2 | null;
    notes: string[];
  };
}

export type ClipState = "uploaded" | "queued" | "aligning" | "aligned" | "ambiguous" | "failed";

export interface Job {
  id: string;
  state: "queued" | "running" | "succeeded" | "failed" | "cancelled";
  stage: string | null;
  progress: number;
  attempts: number;
  max_attempts: number;
  version: number;
}

export interface Alternative {
  map_from_clip: Pose2;
  loss_m: number;
  inliers: number;
  probability: number | null;
  misplaced: number | null;
  free_space: { blocked_rays: number; hits_on_floor: number; unseen_sides: number; walls_on_floor: number } | null;
}

export interface Alignment {
  state: "aligned" | "ambiguous" | "failed";
  probability: number | null;
  map_from_clip: Pose2 | null;
  loss_m: number | null;
  inliers: number | null;
  coverage: number | null;
  alternatives: Alternative[];
  reasons: Reason[];
  hits: number;
  key_frames: number;
  floor: { assumed: boolean; camera_height_m: number } | null;
  completion: { taken: boolean; views: unknown[]; imagined_by: string[] } | null;
  labels: { by: string; key_frames: number } | null;
  seconds: Record<string, number>;
}

export interface Clip {
  id: string;
  home: string;
  state: ClipState;
  reasons: Reason[];
  size_bytes: number;
  info: {
    layout: string;
    frames: number;
    frames_with_pose: number;
    color_width: number;
    color_height: number;
    depth_width: number;
    depth_height: number;
    duration_s: number | null;
    gravity: string;
    intrinsics: string;
    depth_unit: string;
    pose_convention: string;
    notes: string[];
  };
  alignment?: Alignment | null;
  job?: Job | null;
  /** A person's choice. */
  choice?: { map_from_clip: Pose2; alternative: number | null; chosen_at: string } | null;
  /** Where the newest map has the clip. */
  placement?: { map_from_clip: Pose2; by: string; probability: number | null } | null;
  recorded_at?: string | null;
  created_at: string;
  updated_at: string;
}

export interface MapClip {
  clip: string;
  map_from_clip: Pose2 | null;
  by: string | null;
  probability: number | null;
  points: number | null;
}

export interface HomeMap {
  revision: number;
  lidar_map_revision: number;
  created_at: string;
  clips: MapClip[];
  info: {
    points: number;
    voxel_m: number;
    min_m: [number, number, number] | null;
    max_m: [number, number, number] | null;
    classes: { class: string; points: number }[];
  };
}

export interface Room {
  id: string;
  name: string | null;
  area_m2: number;
  polygon_m: [number, number][];
  holes_m?: [number, number][][];
  label_at_m: [number, number];
}

export interface Thing {
  id: string;
  class: string;
  confidence: number;
  centre_m: [number, number, number];
  size_m: [number, number, number];
  yaw_rad: number;
  room: string | null;
}

/** What a virtual LiDAR saw in a clip, in the clip's frame. */
export interface Scan {
  hits_m: [number, number][];
  cameras: { position_m: [number, number, number]; forward: [number, number, number] }[];
}

export interface Class {
  id: number;
  name: string;
  color: string;
  is_fixed: boolean;
}
