// Files of a phone or a computer that look like a clip or a map to a person, and are neither: found by their first
// bytes, so that a person is helped before the upload.

/** A film, a photo, a picture without a map, a finished 3D model, and a drawing or another document. */
export type Foreign = "video" | "photo" | "picture" | "model" | "document";

/** Bytes that decide. */
export const HEAD_BYTES = 64;
/** A map's picture is smaller; larger ones are not searched for a map. */
const MOST_PNG_BYTES = 16 << 20;

/** Beginnings of files: the offset, the bytes as Latin-1 text, and the kind. */
const BEGINNINGS: [offset: number, text: string, kind: Foreign][] = [
  [0, "\xff\xd8\xff", "photo"], [0, "GIF8", "photo"], [0, "II*\0", "photo"], [0, "MM\0*", "photo"], [8, "WEBP", "photo"],
  [0, "\0\0\0\x0cJXL ", "photo"], [8, "AVI ", "video"], [0, "\x1a\x45\xdf\xa3", "video"], [0, "FLV\x01", "video"],
  [0, "\0\0\x01\xba", "video"], [0, "\x30\x26\xb2\x75\x8e\x66\xcf\x11", "video"],
  [0, "P5\n", "picture"], [0, "P5 ", "picture"], [0, "P2\n", "picture"], [0, "P2 ", "picture"],
  [0, "%PDF", "document"], [0, "AC10", "document"], [0, "LASF", "model"], [0, "ASTM-E57", "model"], [0, "glTF", "model"],
];
/** The first box of films and of photos of telephones (ISO 14496-12), and of old QuickTime films. */
const FIRST_BOXES = ["ftyp", "moov", "mdat", "wide", "pnot"];
/** Brands of `ftyp` that are pictures: HEIF, AVIF and Canon's raw ones. */
const PICTURE_BRANDS = ["heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1", "avif", "avis", "crx "];
/** Sizes of the second header of a BMP, whose own mark has two letters only. */
const BMP_HEADERS = [12, 40, 52, 56, 64, 108, 124];

/** The kind of a file by its first bytes; null if they do not tell it. A PNG is a `picture`. */
export function foreignBy(head: Uint8Array): Foreign | null {
  const text = new TextDecoder("latin1").decode(head);
  // The decoder of "latin1" is that of Windows, which has other letters from 0x80 to 0x9f.
  const has = (offset: number, bytes: string) => [...bytes].every((letter, i) => head[offset + i] === letter.charCodeAt(0));
  const known = BEGINNINGS.find(([offset, bytes]) => has(offset, bytes));
  if (known) return known[2];
  if (has(0, "\x89PNG")) return "picture";
  if (FIRST_BOXES.includes(text.slice(4, 8))) return PICTURE_BRANDS.includes(text.slice(8, 12)) ? "photo" : "video";
  if (has(0, "BM") && BMP_HEADERS.includes(head[14] ?? 0) && has(15, "\0\0\0")) return "picture";
  return null;
}

const BY_ENDING: [kind: Foreign, endings: string][] = [
  ["video", "mp4 mov m4v avi mkv webm 3gp 3g2 mts m2ts wmv mpg mpeg insv"],
  ["photo", "jpg jpeg heic heif avif webp gif tif tiff dng cr2 cr3 nef arw raf"],
  ["picture", "bmp"],
  ["model", "usdz usd usdc obj fbx stl glb gltf dae 3ds 3mf blend skp e57 las laz splat spz"],
  ["document", "pdf dwg dxf svg ai doc docx xls xlsx ppt pptx pages html htm"],
];

/** The kind of a file by its name, if its bytes do not tell it. */
export function foreignByName(name: string): Foreign | null {
  const ending = endingOf(name);
  return BY_ENDING.find(([, endings]) => endings.split(" ").includes(ending))?.[0] ?? null;
}

export function endingOf(name: string): string {
  return name.toLowerCase().split(".").pop() ?? "";
}

/** True for a PNG of Valetudo with the map inside: its chunk `zTXt` begins with the map's name. */
export async function hasValetudoMap(file: File): Promise<boolean> {
  if (file.size > MOST_PNG_BYTES) return false;
  const bytes = new Uint8Array(await file.arrayBuffer());
  const view = new DataView(bytes.buffer);
  // A chunk has a length, a type, the data and a checksum (RFC 2083, section 3.2); the first one follows the mark.
  for (let at = 8; at + 12 <= bytes.length; at += view.getUint32(at) + 12) {
    const text = new TextDecoder("latin1").decode(bytes.subarray(at + 4, at + 8 + "ValetudoMap".length));
    if (text === "zTXtValetudoMap") return true;
  }
  return false;
}

/** The kind of a zip's content if it has nothing but films and photos; a recording with depth has more. */
export function foreignInZip(names: readonly string[]): Foreign | null {
  const files = names.filter((name) => !/(^|[/\\])(\.|__MACOSX)|[/\\]$/.test(name));
  const kinds = new Set(files.map((name) => (/depth|conf/i.test(name) ? null : foreignByName(name))));
  if (files.length === 0 || [...kinds].some((kind) => kind !== "video" && kind !== "photo")) return null;
  return kinds.has("video") ? "video" : "photo";
}
