import assert from "node:assert/strict";
import { test } from "node:test";
import { deflateSync } from "node:zlib";
import { kindOf, kindOfZip } from "../src/upload/kind.ts";
import { levelIdOf } from "../src/upload/level.ts";
import { foreignBy } from "../src/upload/media.ts";
import { levelWord } from "../src/words.ts";

const latin = (text: string) => Uint8Array.from(text, (letter) => letter.charCodeAt(0));

/** A box of ISO 14496-12 with its brand. */
const box = (kind: string, brand: string) => `\0\0\0\x18${kind}${brand}${"\0".repeat(40)}`;
const bmp = `BM${"\0".repeat(12)}\x28\0\0\0${"\0".repeat(40)}`;

test("films, photos and models are known by their first bytes", () => {
  for (const [head, kind] of [
    [box("ftyp", "qt  "), "video"], [box("ftyp", "isom"), "video"], [box("ftyp", "heic"), "photo"], [box("ftyp", "avif"), "photo"],
    [box("mdat", "\0\0\0\0"), "video"], ["\x1a\x45\xdf\xa3", "video"], ["RIFF\0\0\0\0AVI LIST", "video"], ["RIFF\0\0\0\0WEBPVP8 ", "photo"],
    ["\xff\xd8\xff\xe0\0\x10JFIF", "photo"], ["II*\0\x08\0\0\0", "photo"], ["GIF89a", "photo"], [bmp, "picture"], ["P5\n2 1\n255\n", "picture"],
    ["\x89PNG\r\n\x1a\n", "picture"], ["%PDF-1.7", "document"], ["glTF\x02\0\0\0", "model"],
    // Recordings and maps.
    ["PK\x03\x04", null], ["\x89MCAP0\r\n", null], ["SQLite format 3\0", null], ["{\"class\":\"ValetudoMap\"", null], ["ply\nformat", null],
    ["rr\x14\0", null], ["x,y\n1,2\n", null], ["BMW 320\n", null], ["", null],
  ] as const) {
    assert.equal(foreignBy(latin(head)), kind, JSON.stringify(head));
  }
});

/** A PNG with one chunk, as RFC 2083 has it; nobody looks at the checksum. */
function png(kind: string, data: Uint8Array): Uint8Array<ArrayBuffer> {
  const head = new Uint8Array(16);
  head.set(latin("\x89PNG\r\n\x1a\n"));
  new DataView(head.buffer).setUint32(8, data.length);
  head.set(latin(kind), 12);
  return new Uint8Array([...head, ...data, 0, 0, 0, 0]);
}

test("a picture with a map inside is a map, and any other is a picture", async () => {
  const map = [...latin("ValetudoMap\0\0"), ...deflateSync("{}")];
  for (const [bytes, kind] of [[png("zTXt", new Uint8Array(map)), "map"], [png("tEXt", latin("Title\0ValetudoMap")), "picture"]] as const) {
    assert.equal(await kindOf(new File([bytes], "map.png")), kind);
  }
});

test("the content goes before the name, and the name before a question", async () => {
  for (const [name, head, kind] of [
    ["IMG_0042.MOV", box("ftyp", "qt  "), "video"], ["video.json", box("ftyp", "isom"), "video"], ["old.wmv", "??", "video"],
    ["room.usdz", "PK\x03\x04", "model"], ["plan.dwg", "??", "document"], ["map.json", "{}", "map"], ["a.r3d", "PK", "clip"],
    ["what", "??", null],
  ] as const) {
    assert.equal(await kindOf(new File([latin(head)], name)), kind, name);
  }
});

// As APPNOTE 4.3.12 and 4.3.16 have it.
const entry = (name: string) => `PK\x01\x02${"\0".repeat(24)}${String.fromCharCode(name.length)}${"\0".repeat(17)}${name}`;
const end = (files: number) => `PK\x05\x06${"\0".repeat(6)}${String.fromCharCode(files)}${"\0".repeat(11)}`;
const zip = (names: string[], files = names.length) => latin(names.map(entry).join("") + end(files));

test("an archive of films and photos alone is no recording", () => {
  for (const [names, kind] of [
    [["IMG_1.HEIC", "IMG_2.JPG"], "photo"], [["album/", "album/a.jpg", "album/b.mov", "__MACOSX/._a.jpg"], "video"],
    [["rgb.mp4", "odometry.csv", "depth/0.png"], "clip"], [["color/0.jpg", "depth/0.jpg"], "clip"], [["frame-1.color.png"], "clip"],
    [["map.yaml", "map.pgm"], "map"], [["notes.txt"], null], [[], null],
  ] as const) {
    assert.equal(kindOfZip(zip([...names])), kind, names.join());
  }
  // The list is longer than its part that was read.
  assert.equal(kindOfZip(zip(["color/1.jpg"], 3)), "clip");
});

test("a level has the id that its name gives, and no id twice", () => {
  for (const [name, id] of [
    ["First floor", "first-floor"], ["Dachgeschoß", "dachgeschoss"], [" 2. OG ", "2-og"], ["二階", "level-3"], ["", null], ["  ", null], ["Main", null],
    ["UPPER", null], ["a very long name of a level of a home", "a-very-long-name-of-a-level-of-a"],
  ] as const) {
    assert.equal(levelIdOf(name, ["main", "upper"]), id, name);
    if (id) assert.match(id, /^[a-z0-9_-]{1,32}$/);
  }
  assert.equal(levelIdOf("二階", ["main", "level-3"]), "level-4");
  assert.deepEqual(["main", "first-floor", "level_2"].map(levelWord), ["Main", "First floor", "Level 2"]);
});
