// The service's problems in the words of the page. Those that are not listed here are told in the service's own words.

const BUSY = "The service is busy. Try again in a moment.";
const NOT_IN_MAP = "The newest map does not have it any more.";

const INCOMPLETE = "The file is incomplete: its end is missing. Export the recording again, or send the whole file again.";
const NO_NAME = "This cannot be a name. Use letters, digits and signs, and not only spaces.";

/**
 * By the code at the end of a problem's `type`, and after a space its `field` if the words are about that one; docs/api.md lists
 * the codes.
 */
const WORDS: Record<string, string> = {
  "home-not-found": "There is no home at this address. It may have been deleted.",
  "clip-not-found": "There is no clip at this address. It may have been deleted.",
  "invalid-path clip": "There is no clip at this address. It may have been deleted.",
  "lidar-map-not-found": "This LiDAR map is not there any more.",
  "map-not-found": "The home has no map of its clips yet.",
  "object-not-found": NOT_IN_MAP,
  "room-not-found": NOT_IN_MAP,
  "result-not-found": "The clip does not have this file.",
  "changed-meanwhile": "Somebody else changed it meanwhile. Look at it again, then repeat what you did.",
  "invalid-body name": NO_NAME,
  "invalid-body title": NO_NAME,
  "invalid-body merge_with": "These rooms cannot become one: they do not meet at a wall, or the map has changed meanwhile.",
  "invalid-body split_by": "The line does not divide the room. Choose two points on its walls, so that each part has at least 0.5 m². If " +
    "another line divides the room already, withdraw its corrections first.",
  "job-ended": "It has ended already.",
  "no-lidar-map": "The home has no LiDAR map yet. Add it first.",
  "no-answer-yet": "The clip has no places to choose from yet. Wait until the service has looked for them.",
  "key-missing": "Nobody is signed in.",
  "session-ended": "You are signed out.",
  "too-many-requests": "These were too many requests at once. Wait a moment, then try again.",
  "too-many-uploads": "Too many uploads are unfinished. Wait until some of them are stored.",
  "body-too-large": "The file is larger than this service takes. Record shorter clips, one for each room.",
  "unknown-layout": "The service does not know this kind of recording. “Which files, and how do I get them?” names the apps that work.",
  "unknown-format": "The service does not know this kind of map. “Which files, and how do I get them?” names the maps that work.",
  "not-an-archive": "The file is neither a recording nor a map. “Which files, and how do I get them?” names those that work.",
  "three-dimensional-map": "This is a 3D scan. The LiDAR map is the flat map that the robot vacuum measured.",
  "image-without-yaml": "The picture of a ROS map needs its .yaml file. Pack both into one zip, and add the zip.",
  "zip-truncated": INCOMPLETE,
  "tar-truncated": INCOMPLETE,
  "packing-truncated": INCOMPLETE,
  "tenant-full": "The storage of your account is full. Delete clips or homes, or ask the operator of the service for more.",
  "storage-full": "The service has no storage left. Tell the person who runs it.",
  "internal-error": "A fault of the service. Try again; if it stays, tell the person who runs the service.",
  "unavailable": BUSY,
  "readers-busy": BUSY,
  "makers-busy": BUSY,
  "stopping": "The service is restarting. Try again in a moment.",
};

/** The words for a problem's `type` and `field`; null if the service's own are to be told. */
export function wordsFor(type: unknown, field: unknown = null): string | null {
  const [, code = ""] = /^urn:viola:problem:(.+)$/.exec(String(type)) ?? [];
  return WORDS[`${code} ${String(field)}`] ?? WORDS[code] ?? null;
}
