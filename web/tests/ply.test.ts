import assert from "node:assert/strict";
import { test } from "node:test";
import { MAX_POINTS, NotPly, PlyStream, type Points, readHeader } from "../src/cloud/ply.ts";

const OLD = [
  "float x", "float y", "float z", "float nx", "float ny", "float nz", "uchar red", "uchar green", "uchar blue",
  "uchar label", "float probability", "ushort views",
];
const NEW = [...OLD, "ushort clip"];

function header(properties: string[], count: number | string, more = ""): string {
  const lines = properties.map((property) => `property ${property}\n`).join("");
  const start = `ply\nformat binary_little_endian 1.0\ncomment frame map\nelement vertex ${count}\n`;
  return `${start}${lines}${more}end_header\n`;
}

/** Vertices whose figures follow from their number. */
function file(properties: string[], count: number): Uint8Array {
  const sizes: Record<string, number> = { float: 4, double: 8, uchar: 1, ushort: 2 };
  const stride = properties.reduce((sum, property) => sum + (sizes[property.split(" ")[0] ?? ""] ?? 0), 0);
  const head = new TextEncoder().encode(header(properties, count));
  const bytes = new Uint8Array(head.length + stride * count);
  bytes.set(head);
  const view = new DataView(bytes.buffer);
  let at = head.length;
  for (let i = 0; i < count; i++) {
    const values: Record<string, number> = {
      x: i, y: -i, z: i / 2, nx: 0, ny: 1, nz: 0, red: i % 256, green: 2, blue: 3, label: i % 35,
      probability: 0.5, views: 1000, clip: 257 + i,
    };
    for (const property of properties) {
      const [type = "", name = ""] = property.split(" ");
      const value = values[name] ?? 0;
      if (type === "float") view.setFloat32(at, value, true);
      else if (type === "double") view.setFloat64(at, value, true);
      else if (type === "ushort") view.setUint16(at, value, true);
      else view.setUint8(at, value);
      at += sizes[type] ?? 0;
    }
  }
  return bytes;
}

function read(bytes: Uint8Array, pieces: number): { points: Points[]; stream: PlyStream } {
  const stream = new PlyStream();
  const points: Points[] = [];
  for (let at = 0; at < bytes.length; at += pieces) {
    const more = stream.push(bytes.subarray(at, at + pieces));
    if (more) points.push(more);
  }
  stream.end();
  return { points, stream };
}

function all(points: Points[], name: keyof Points): number[] {
  return points.flatMap((some) => [...some[name]]);
}

test("points are the same in pieces of any size", () => {
  const bytes = file(NEW, 40);
  const whole = read(bytes, bytes.length);
  assert.equal(whole.stream.header?.stride, 36);
  for (const pieces of [1, 7, 36, 100, 1000]) {
    const { points } = read(bytes, pieces);
    for (const name of ["position", "tint", "kind", "normal"] as const) {
      assert.deepEqual(all(points, name), all(whole.points, name), `${name} in pieces of ${pieces}`);
    }
  }
  const [points] = whole.points;
  assert.deepEqual([...(points?.position.slice(9, 12) ?? [])], [3, -3, 1.5]);
  assert.deepEqual([...(points?.tint.slice(12, 16) ?? [])], [3, 2, 3, 255]);
  // Class 3, half sure, clip 260 as low and high byte.
  assert.deepEqual([...(points?.kind.slice(12, 16) ?? [])], [3, 128, 4, 1]);
  assert.deepEqual([...(points?.normal.slice(12, 15) ?? [])], [0, 127, 0]);
});

test("properties may be missing, in another order and of another type", () => {
  const bare = ["float x", "float y", "float z"];
  for (const properties of [OLD, bare, ["uchar label", "double z", "double y", "double x"]]) {
    const { points } = read(file(properties, 5), 50);
    assert.deepEqual(all(points, "position").slice(-3), [4, -4, 2], properties.join());
    assert.deepEqual(all(points, "kind").slice(-2), [0, 0], "without a clip it is the first");
  }
});

test("what follows the vertices is left alone", () => {
  const bytes = file(NEW, 3);
  const longer = new Uint8Array(bytes.length + 99);
  longer.set(bytes);
  assert.equal(all(read(longer, 17).points, "position").length, 9);
});

test("a header that is not whole yet is waited for", () => {
  const text = new TextEncoder().encode(header(NEW, 1));
  for (let length = 0; length < text.length; length++) assert.equal(readHeader(text.subarray(0, length)), null);
  assert.equal(readHeader(text)?.body, text.length);
});

test("what is not such a file is refused", () => {
  const bad: [string, string | Uint8Array][] = [
    ["a web page", "<!doctype html>"],
    ["text PLY", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n"],
    ["no x", header(["float y", "float z"], 1)],
    ["faces first", "ply\nformat binary_little_endian 1.0\nelement face 1\nend_header\n"],
    ["a list", header(["float x", "float y", "float z", "list uchar int vertex_indices"], 1)],
    ["too many", header(NEW, MAX_POINTS + 1)],
    ["fewer than none", header(NEW, -1)],
    ["no number", header(NEW, "many")],
    ["a header without an end", `ply\n${"comment x\n".repeat(2000)}`],
    ["cut off", file(NEW, 4).subarray(0, -1)],
    ["nothing", ""],
  ];
  for (const [name, content] of bad) {
    const bytes = typeof content === "string" ? new TextEncoder().encode(content) : content;
    assert.throws(() => read(bytes, 64), NotPly, name);
  }
});

test("scattered points are all there, and a part of them is an even sample", () => {
  for (const count of [1, 2, 3, 10, 997, 5000]) {
    const bytes = file(["float x", "float y", "float z"], count);
    const stream = new PlyStream(true);
    const x = [...(stream.push(bytes)?.position ?? [])].filter((_, i) => i % 3 === 0);
    assert.deepEqual(x.toSorted((a, b) => a - b), Array.from({ length: count }, (_, i) => i));
    if (count < 100) continue;
    const sample = x.slice(0, 50).sort((a, b) => a - b);
    const gaps = sample.map((value, i) => value - (sample[i - 1] ?? 0));
    assert.ok(Math.max(...gaps) < (3 * count) / 50, `a gap of ${Math.max(...gaps)} in ${count}`);
  }
});
