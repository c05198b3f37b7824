// The files of a home that the service gives for other programs: one row each, in the groups of people who want them.

export const FOR = [
  "To look at and to print", "For drawings and 3D programs", "For robots and smart homes", "For surveyors", "For programmers", "To keep",
] as const;

export interface HomeFile {
  /** The people that it is for. */
  group: (typeof FOR)[number];
  word: string;
  format: string;
  /** Below the home's path. */
  path: string[];
  /** The file needs a map, a LiDAR map, or either that or a clip. */
  needs: "map" | "lidar" | "anything";
  /** One file for each level. */
  ofLevel?: boolean;
}

const [LOOK, DRAW, ROBOT, SURVEY, PROGRAM, KEEP] = FOR;

const map = (group: HomeFile["group"], word: string, format: string, path: string, ofLevel = true): HomeFile =>
  ({ group, word, format, path: ["map", path], needs: "map", ofLevel });

export const FILES: readonly HomeFile[] = [
  map(LOOK, "Floor plan to print", "PDF", "plan?format=pdf"),
  map(LOOK, "Floor plan, picture", "PNG", "plan?format=png"),
  { group: LOOK, word: "Picture of the LiDAR map", format: "PNG", path: ["lidar-maps", "{level}", "image.png"], needs: "lidar" },
  map(LOOK, "Surface for phones", "USDZ", "mesh?format=usdz"),
  map(DRAW, "Floor plan, vector", "SVG", "plan?format=svg"),
  map(DRAW, "Floor plan for CAD", "DXF", "plan?format=dxf"),
  map(DRAW, "Surface for 3D programs", "GLB", "mesh?format=glb"),
  map(DRAW, "Surface as text", "OBJ", "mesh?format=obj"),
  map(DRAW, "Points for 3D programs", "GLB", "points?format=glb"),
  map(ROBOT, "Masks for Nav2", "ZIP", "robot?format=nav2"),
  map(ROBOT, "Zones and goals for Valetudo", "JSON", "robot?format=valetudo"),
  map(ROBOT, "Map card of Home Assistant", "JSON", "robot?format=calibration"),
  map(ROBOT, "Areas for Matter", "JSON", "robot?format=matter", false),
  map(ROBOT, "Recording for Foxglove", "MCAP", "recording?format=mcap"),
  map(SURVEY, "Points for surveyors", "E57", "points?format=e57"),
  map(SURVEY, "Points for surveyors, packed", "LAZ", "points?format=laz"),
  map(SURVEY, "Points with classes", "PLY", "points?format=ply"),
  map(SURVEY, "Floor plan for maps", "GeoJSON", "plan?format=geojson"),
  map(PROGRAM, "Floor plan, model", "JSON", "plan?format=json"),
  map(PROGRAM, "Objects", "JSON", "objects"),
  map(PROGRAM, "Rooms", "JSON", "rooms"),
  map(PROGRAM, "Coverage", "JSON", "coverage"),
  map(PROGRAM, "Corrections", "JSON", "corrections", false),
  { group: KEEP, word: "Everything, with recordings", format: "ZIP", path: ["export"], needs: "anything" },
];
