// Reads binary little-endian PLY by the names of its properties, as its bytes arrive.

/** More points than a browser can show; a header that says so is refused. */
export const MAX_POINTS = 30_000_000;
/** A header is a few hundred bytes. */
const MAX_HEADER = 16_384;

export class NotPly extends Error {}

const SIZES: Record<string, number> = {
  char: 1, uchar: 1, int8: 1, uint8: 1,
  short: 2, ushort: 2, int16: 2, uint16: 2,
  int: 4, uint: 4, int32: 4, uint32: 4, float: 4, float32: 4,
  double: 8, float64: 8,
};

interface Property {
  at: number;
  type: string;
}

interface Header {
  /** Vertices. */
  count: number;
  /** Bytes of one vertex. */
  stride: number;
  properties: Map<string, Property>;
  /** Offset of the first vertex. */
  body: number;
}

/** The header at the beginning of `bytes`; null while its end has not come. */
export function readHeader(bytes: Uint8Array): Header | null {
  const text = new TextDecoder("latin1").decode(bytes.subarray(0, MAX_HEADER));
  if (!"ply\n".startsWith(text.slice(0, 4))) throw new NotPly("The answer is not a PLY file.");
  const end = /(^|\n)end_header\r?\n/.exec(text);
  if (!end) {
    if (bytes.length >= MAX_HEADER) throw new NotPly("The PLY file's header has no end.");
    return null;
  }
  const header = { count: 0, stride: 0, properties: new Map<string, Property>(), body: end.index + end[0].length };
  let element = "";
  for (const line of text.slice(0, end.index).split("\n")) {
    const [word, ...rest] = line.trim().split(/\s+/);
    if (word === "format" && rest[0] !== "binary_little_endian") {
      throw new NotPly(`The PLY file is ${rest[0]}; only binary_little_endian is read.`);
    }
    if (word === "element") {
      if (!element && rest[0] !== "vertex") throw new NotPly("The PLY file does not begin with vertices.");
      element = rest[0] ?? "";
      if (element === "vertex") header.count = Number(rest[1]);
    }
    if (word === "property" && element === "vertex") {
      const [type = "", name = ""] = rest;
      const size = SIZES[type];
      if (!size) throw new NotPly(`The PLY file has a vertex property of type ${type}.`);
      header.properties.set(name, { at: header.stride, type });
      header.stride += size;
    }
  }
  if (!Number.isInteger(header.count) || header.count < 0 || header.count > MAX_POINTS) {
    throw new NotPly(`The PLY file has ${header.count} points; at most ${MAX_POINTS} are shown.`);
  }
  for (const axis of ["x", "y", "z"]) {
    if (!header.properties.has(axis)) throw new NotPly(`The PLY file's vertices have no ${axis}.`);
  }
  return header;
}

/** Points ready for the graphics card. */
export interface Points {
  /** x, y, z in metres. */
  position: Float32Array;
  /** Red, green, blue, and how many views saw the point (at most 255). */
  tint: Uint8Array;
  /** Class, probability in 255ths, and the clip's index, its low byte first. */
  kind: Uint8Array;
  /** The normal in 127ths; zeros where there is none. */
  normal: Int8Array;
}

export function emptyPoints(count: number): Points {
  return {
    position: new Float32Array(count * 3),
    tint: new Uint8Array(count * 4),
    kind: new Uint8Array(count * 4),
    normal: new Int8Array(count * 4),
  };
}

type Read = (vertex: number) => number;

function reader(view: DataView, property: Property | undefined, otherwise: number): Read {
  if (!property) return () => otherwise;
  const { at, type } = property;
  switch (type) {
    case "float":
    case "float32":
      return (vertex) => view.getFloat32(vertex + at, true);
    case "double":
    case "float64":
      return (vertex) => view.getFloat64(vertex + at, true);
    case "uchar":
    case "uint8":
      return (vertex) => view.getUint8(vertex + at);
    case "char":
    case "int8":
      return (vertex) => view.getInt8(vertex + at);
    case "ushort":
    case "uint16":
      return (vertex) => view.getUint16(vertex + at, true);
    case "short":
    case "int16":
      return (vertex) => view.getInt16(vertex + at, true);
    case "int":
    case "int32":
      return (vertex) => view.getInt32(vertex + at, true);
    default:
      return (vertex) => view.getUint32(vertex + at, true);
  }
}

/**
 * A step that goes through `count` places and comes to each once, in leaps of about the golden section: the first
 * part of what is laid out so is an even sample of the whole, however small the part is.
 */
function scatterStep(count: number): number {
  const divisor = (a: number, b: number): number => (b === 0 ? a : divisor(b, a % b));
  let step = Math.max(1, Math.round(count * 0.6180339887));
  while (divisor(count, step) > 1) step++;
  return step;
}

/** The whole vertices in `bytes`, which begins at a vertex; at place n goes the one n times `step`. */
function readVertices(bytes: Uint8Array, header: Header, step = 1): Points {
  const count = Math.floor(bytes.length / header.stride);
  const points = emptyPoints(count);
  const { position, tint, kind, normal } = points;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const of = (name: string, otherwise: number) => reader(view, header.properties.get(name), otherwise);
  const [x, y, z] = [of("x", 0), of("y", 0), of("z", 0)];
  const [nx, ny, nz] = [of("nx", 0), of("ny", 0), of("nz", 0)];
  const [red, green, blue] = [of("red", 160), of("green", 160), of("blue", 160)];
  const [label, probability, views, clip] = [of("label", 0), of("probability", 1), of("views", 1), of("clip", 0)];
  for (let i = 0, from = 0; i < count; i++, from = (from + step) % count) {
    const vertex = from * header.stride;
    position[3 * i] = x(vertex);
    position[3 * i + 1] = y(vertex);
    position[3 * i + 2] = z(vertex);
    tint[4 * i] = red(vertex);
    tint[4 * i + 1] = green(vertex);
    tint[4 * i + 2] = blue(vertex);
    tint[4 * i + 3] = Math.min(255, views(vertex));
    kind[4 * i] = label(vertex);
    kind[4 * i + 1] = Math.round(255 * Math.min(1, Math.max(0, probability(vertex))));
    const index = clip(vertex);
    kind[4 * i + 2] = index & 255;
    kind[4 * i + 3] = index >> 8;
    normal[4 * i] = 127 * nx(vertex);
    normal[4 * i + 1] = 127 * ny(vertex);
    normal[4 * i + 2] = 127 * nz(vertex);
  }
  return points;
}

/** Takes a file in pieces of any size and gives its points as soon as they are whole. */
export class PlyStream {
  header: Header | null = null;
  private rest = new Uint8Array(0);
  private given = 0;

  /** Each piece is laid out in its own order, or scattered. */
  constructor(private readonly isScattered = false) {}

  /** The points that `chunk` completes; null before the header is whole or when there are none. */
  push(chunk: Uint8Array): Points | null {
    let bytes = chunk;
    if (this.rest.length > 0) {
      bytes = new Uint8Array(this.rest.length + chunk.length);
      bytes.set(this.rest);
      bytes.set(chunk, this.rest.length);
    }
    if (!this.header) {
      this.header = readHeader(bytes);
      if (!this.header) {
        this.rest = bytes.slice();
        return null;
      }
      bytes = bytes.subarray(this.header.body);
    }
    const { stride, count } = this.header;
    // Other elements follow the vertices.
    const whole = Math.min(Math.floor(bytes.length / stride), count - this.given);
    this.rest = bytes.slice(whole * stride);
    if (this.given + whole >= count) this.rest = new Uint8Array(0);
    if (whole === 0) return null;
    this.given += whole;
    const step = this.isScattered ? scatterStep(whole) : 1;
    return readVertices(bytes.subarray(0, whole * stride), this.header, step);
  }

  /** Refuses a file that ended before its last vertex. */
  end(): void {
    if (!this.header) throw new NotPly("The answer is not a PLY file.");
    if (this.given < this.header.count) {
      throw new NotPly(`The points ended after ${this.given} of ${this.header.count}.`);
    }
  }
}
