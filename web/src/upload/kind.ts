// The kind of a chosen file: a clip, a LiDAR map, or something else. It decides the route of the upload; the service finds
// the format by content.

import { endingOf, type Foreign, foreignBy, foreignByName, foreignInZip, HEAD_BYTES, hasValetudoMap } from "./media.ts";

export type Kind = "clip" | "map";

/** Zips list their files at the end, by plain names. */
const TAIL_BYTES = 1 << 18;

/** Decides by the name; zips hold both, and null says that one must look inside. */
export function kindOfName(name: string): Kind | null {
  const ending = endingOf(name);
  if (["r3d", "sens", "db", "db3", "mcap"].includes(ending)) return "clip";
  if (["json", "yaml", "yml", "csv", "ply", "pcd", "pgm", "png", "txt", "xyz", "bin", "rrmap", "clf"].includes(ending)) return "map";
  return null;
}

/** The names in a zip's list of files (APPNOTE 4.3.12); those before the tail are left out. */
function namesOfZip(tail: Uint8Array): string[] {
  const names = [];
  const bytes = new DataView(tail.buffer, tail.byteOffset, tail.byteLength);
  for (let at = 0; at + 46 <= tail.length; at++) {
    if (bytes.getUint32(at) !== 0x504b0102) continue;
    const length = bytes.getUint16(at + 28, true);
    names.push(new TextDecoder("latin1").decode(tail.subarray(at + 46, at + 46 + length)));
  }
  return names;
}

/** The number of files that a zip says it has at its end (APPNOTE 4.3.16); null without such an end. */
function filesOfZip(tail: Uint8Array): number | null {
  const bytes = new DataView(tail.buffer, tail.byteOffset, tail.byteLength);
  for (let at = tail.length - 22; at >= 0; at--) {
    if (bytes.getUint32(at) === 0x504b0506) return bytes.getUint16(at + 10, true);
  }
  return null;
}

/** Decides by the names in a zip's list; null when they say nothing, and for other files. */
export function kindOfZip(tail: Uint8Array): Kind | Foreign | null {
  const names = namesOfZip(tail);
  const text = names.join("\n");
  // A part of the list says nothing about the other files.
  const foreign = filesOfZip(tail) === names.length ? foreignInZip(names) : null;
  if (foreign) return foreign;
  if (/(depth|color|colour|rgb|frame|pose)[^/\\]*[/\\.\-_0-9]/i.test(text)) return "clip";
  if (/\.(ya?ml|pgm)/i.test(text)) return "map";
  return null;
}

/** Null when the person must say. */
export async function kindOf(file: File): Promise<Kind | Foreign | null> {
  const foreign = foreignBy(new Uint8Array(await file.slice(0, HEAD_BYTES).arrayBuffer()));
  if (foreign === "picture" && (await hasValetudoMap(file))) return "map";
  if (foreign) return foreign;
  const byName = kindOfName(file.name) ?? foreignByName(file.name);
  if (byName) return byName;
  const tail = file.slice(Math.max(0, file.size - TAIL_BYTES));
  return kindOfZip(new Uint8Array(await tail.arrayBuffer()));
}

export function isKind(found: Kind | Foreign | null): found is Kind {
  return found === "clip" || found === "map";
}
