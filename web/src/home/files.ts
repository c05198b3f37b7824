// The files of a home that the service gives for other programs: one row each.

export interface HomeFile {
  word: string;
  format: string;
  /** Below the home's path. */
  path: string[];
  /** The file needs a map, a LiDAR map, or either that or a clip. */
  needs: "map" | "lidar" | "anything";
  /** One file for each level. */
  ofLevel?: boolean;
}

const map = (word: string, format: string, path: string, ofLevel = true): HomeFile =>
  ({ word, format, path: ["map", path], needs: "map", ofLevel });

export const FILES: readonly HomeFile[] = [
  map("Floor plan, vector", "SVG", "plan?format=svg"),
  map("Floor plan, picture", "PNG", "plan?format=png"),
  map("Floor plan to print", "PDF", "plan?format=pdf"),
  map("Floor plan for CAD", "DXF", "plan?format=dxf"),
  map("Floor plan for maps", "GeoJSON", "plan?format=geojson"),
  map("Floor plan, model", "JSON", "plan?format=json"),
  map("Surface for 3D programs", "GLB", "mesh?format=glb"),
  map("Surface for phones", "USDZ", "mesh?format=usdz"),
  map("Surface as text", "OBJ", "mesh?format=obj"),
  map("Points with classes", "PLY", "points?format=ply"),
  map("Points for 3D programs", "GLB", "points?format=glb"),
  map("Points for surveyors", "E57", "points?format=e57"),
  map("Points for surveyors, packed", "LAZ", "points?format=laz"),
  map("Recording for Foxglove", "MCAP", "recording?format=mcap"),
  map("Masks for Nav2", "ZIP", "robot?format=nav2"),
  map("Zones and goals for Valetudo", "JSON", "robot?format=valetudo"),
  map("Map card of Home Assistant", "JSON", "robot?format=calibration"),
  map("Areas for Matter", "JSON", "robot?format=matter", false),
  map("Objects", "JSON", "objects"),
  map("Rooms", "JSON", "rooms"),
  map("Coverage", "JSON", "coverage"),
  map("Corrections", "JSON", "corrections", false),
  { word: "Picture of the LiDAR map", format: "PNG", path: ["lidar-maps", "{level}", "image.png"], needs: "lidar" },
  { word: "Everything, with recordings", format: "ZIP", path: ["export"], needs: "anything" },
];
