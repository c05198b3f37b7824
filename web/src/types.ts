// Answers of the service. `schema.d.ts` is generated from the OpenAPI document: `npm run types`.

import type { components } from "../schema.d.ts";

type Schemas = components["schemas"];
/** The service sends every member, null where there is no value; the document lets it leave such members out. */
type Sent<T> = T extends readonly (infer Item)[]
  ? Sent<Item>[]
  : T extends object
    ? { [Member in keyof T]-?: Sent<T[Member]> }
    : T;
/** The document does not say how long arrays are. */
type With<Name extends keyof Schemas, Members> = Omit<Sent<Schemas[Name]>, keyof Members> & Members;
type Point2 = [number, number];
type Point3 = [number, number, number];

export type Alternative = Sent<Schemas["Alternative"]>;
export type Class = Schemas["Class"];
export type Clip = Sent<Schemas["Clip"]>;
export type ClipState = Schemas["ClipState"];
export type Home = Sent<Schemas["Home"]>;
export type Job = Sent<Schemas["Job"]>;
export type Pose2 = Schemas["Pose2"];
export type PictureFrame = With<"PictureFrame", { corner_m: Point2 }>;
export type Session = Schemas["Session"];
export type Upload = Sent<Schemas["Upload"]>;
export type Room = With<"Room", { polygon_m: Point2[]; holes_m: Point2[][]; label_at_m: Point2 }>;
export type Thing = With<"MapObject", { centre_m: Point3; size_m: Point3 }>;
export type ThingPatch = Partial<{
  class: string | null;
  name: string | null;
  centre_m: null;
  size_m: null;
  yaw_rad: null;
  pinned: boolean | null;
  hidden: boolean | null;
}>;
export type RoomPatch = Partial<{
  name: string | null;
  merge_with: string[] | null;
  split_by: { from_m: Point2; to_m: Point2 } | null;
}>;
export type Coverage = Sent<Schemas["MapCoverage"]>;
export type MapChanges = Omit<Sent<Schemas["MapChanges"]>, "added" | "discovered" | "found_again" | "moved" | "gone" | "lost"> & {
  added: Thing[];
  discovered: Thing[];
  found_again: Thing[];
  lost: { reason: Schemas["LostReason"]; object: Thing }[];
  moved: { from: Thing; to: Thing }[];
  gone: { reason: Schemas["GoneReason"]; object: Thing }[];
};
export type Corrections = Sent<Schemas["Corrections"]>;

/** A room of the robot's own map: it has a middle and no outline. */
export type RobotRoom = With<"RoomInfo", { centre_m: Point2 }>;
type LidarInfo = With<"LidarInfo", { min_m: Point2; max_m: Point2; rooms: RobotRoom[] }>;
export type LidarRevision = With<"LidarMapRevision", { info: LidarInfo }>;
export type LidarMap = With<"CurrentLidarMap", { image: PictureFrame; info: LidarInfo }>;

type HomeMapInfo = With<"HomeMapInfo", { min_m: Point3 | null; max_m: Point3 | null }>;
export type HomeMap = With<"CurrentMap", { info: HomeMapInfo; levels: With<"MapLevel", { info: HomeMapInfo }>[] }>;

/** The hits and cameras of a clip, in its own frame. */
export type Scan = With<"ClipScan", { hits_m: Point2[]; cameras: ScanCamera[] }>;
type ScanCamera = With<"ScanCamera", { position_m: Point3; forward: Point3 }>;

/** A page of a list. */
export interface List<T> {
  items: T[];
  next: string | null;
}
