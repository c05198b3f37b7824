// The layouts of clips as their makers spell them. docs/formats.md describes each.

import { plain } from "../words.ts";

/** By the name in the API. */
export const LAYOUT_WORDS: Record<string, string> = {
  arkit_scenes: "ARKitScenes",
  colmap: "COLMAP",
  nerf_capture: "NeRFCapture",
  nerfstudio: "Nerfstudio",
  points: "Points with a path",
  polycam: "Polycam",
  record3d: "Record3D",
  redwood: "Redwood, Open3D",
  ros2_bag: "ROS 2 bag",
  rtabmap: "RTAB-Map",
  scanner_3d_app: "3D Scanner App",
  scannet: "ScanNet",
  sens: "ScanNet .sens",
  seven_scenes: "7-Scenes",
  spectacular_ai: "Spectacular AI",
  stray_scanner: "Stray Scanner",
  tum_rgbd: "TUM RGB-D",
};

/** The name of a layout for people; a newer service may have other layouts. */
export function layoutWord(layout: string): string {
  return LAYOUT_WORDS[layout] ?? plain(layout);
}
