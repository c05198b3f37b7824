// Help for a person who has no file that the service can use: how to film a clip, and how to get the vacuum's map.

import { h } from "../dom.ts";
import { ask } from "../parts/dialog.ts";
import { many, named } from "../words.ts";
import type { Kind } from "./kind.ts";
import type { Foreign } from "./media.ts";

/** A file that is neither a clip nor a map. */
export interface Refused {
  name: string;
  kind: Foreign;
}

/** Reasons for which the service cannot use a file. */
const REASONS: Record<Foreign, [what: string, why: string]> = {
  video: ["a plain video", "It has no depth: the service measures a home by the distance of every pixel, which a plain video does not have."],
  photo: ["a photo", "It has no depth and shows one view only. A picture of the map in the vacuum's app has no scale, so it is no map either."],
  picture: ["a plain picture", "It has no scale. If it belongs to a ROS map, pack it with its .yaml file into one zip, and add the zip."],
  model: ["a finished 3D model", "It has no pictures and no path of the camera any more. Export the recording itself from the app, as raw data."],
  document: ["a drawing or a document", "The service needs the map that the vacuum's laser measured."],
};

const FILM = [
  "Use a device that measures depth: an iPhone Pro (12 Pro or later) or iPad Pro with LiDAR, or a depth camera.",
  "Film with an app that keeps the depth: Stray Scanner, Record3D, Polycam (raw data), 3D Scanner App (all data), RTAB-Map.",
  "Walk slowly through one room for at least half a minute, with walls, corners and the floor in sight, 0.5 to 4 m away.",
  "Export the recording as it is (.zip, .r3d, .db, .mcap), and add that file.",
];

const MAP = [
  "Let the vacuum map the whole home first.",
  "Valetudo: open http://ADDRESS-OF-THE-ROBOT/api/v2/robot/state/map in a browser, and save the page as a .json file.",
  "Valetudo in Home Assistant: save the picture of the camera “map data”. It is a .png with the map inside.",
  "Roborock, Dreame, Viomi: the map file as the robot uploads it.",
  "ROS: the .yaml and the .pgm of map_saver, in one zip. Points of a laser work too: .csv, .ply, .pcd.",
  "A screenshot or a photo of the app's map does not work.",
];

function guide(title: string, steps: string[], isOpen: boolean): HTMLElement {
  return h("details", { open: isOpen }, h("summary", {}, title), h("ul", {}, ...steps.map((step) => h("li", {}, step))));
}

/** Both guides; that of the wanted kind is open. */
function guides(wanted: Kind): HTMLElement[] {
  return [
    guide("How to film a clip with depth", FILM, wanted === "clip"),
    guide("How to get the vacuum's map", MAP, wanted === "map"),
  ];
}

/** The kind that a person probably wanted to add. */
function wantedBy(refused: readonly Refused[], said: Kind | undefined): Kind {
  const isMap = ({ kind }: Refused) => kind === "picture" || kind === "document";
  return said ?? (refused.every(isMap) ? "map" : "clip");
}

/** Tells why files are refused, and the way to files that work. `said` is the button that the person used. */
export async function explainRefused(refused: readonly Refused[], said: Kind | undefined): Promise<void> {
  const [first] = refused;
  if (!first) return;
  const kinds = [...new Set(refused.map(({ kind }) => kind))];
  const title = refused.length === 1 ? `This is ${REASONS[first.kind][0]}` : `${many(refused.length, "file")} cannot be used`;
  const names = refused.slice(0, 3).map(({ name }) => named(name)).join(", ");
  const more = refused.length > 3 ? `, and ${refused.length - 3} more` : "";
  const why = kinds.map((kind) => h("p", {}, kinds.length > 1 ? `${capital(REASONS[kind][0])}: ${REASONS[kind][1]}` : REASONS[kind][1]));
  await ask(title, h("div", { class: "guide" },
    h("p", {}, `${names}${more} ${refused.length === 1 ? "was" : "were"} not sent.`), ...why, ...guides(wantedBy(refused, said))),
    [{ word: "Close", value: null, kind: "primary" }]);
}

/** Tells which files the service needs. */
export async function explainFiles(): Promise<void> {
  await ask("Clips and the LiDAR map", h("div", { class: "guide" },
    h("p", {}, "A clip is a recording of one room with colour and depth. The LiDAR map is the map that a robot vacuum measured. " +
      "The service finds the place of each clip in the map."), ...guides("clip")),
    [{ word: "Close", value: null, kind: "primary" }]);
}

function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
