// A map as large as the page is made for.

const VERTEX_BYTES = 36;
const PROPERTIES = [
  "float x", "float y", "float z", "float nx", "float ny", "float nz", "uchar red", "uchar green", "uchar blue",
  "uchar label", "float probability", "ushort views", "ushort clip",
];

/** Points on waves between two corners, as the service writes them. */
export function cloudOf(count, low, high) {
  const lines = PROPERTIES.map((property) => `property ${property}\n`).join("");
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${lines}end_header\n`;
  const bytes = Buffer.alloc(header.length + count * VERTEX_BYTES);
  bytes.write(header, "latin1");
  const side = Math.ceil(Math.sqrt(count));
  for (let i = 0, at = header.length; i < count; i++, at += VERTEX_BYTES) {
    const [u, v] = [(i % side) / side, Math.floor(i / side) / side];
    const height = 0.5 + 0.5 * Math.sin(14 * u) * Math.cos(11 * v);
    bytes.writeFloatLE(low[0] + u * (high[0] - low[0]), at);
    bytes.writeFloatLE(low[1] + v * (high[1] - low[1]), at + 4);
    bytes.writeFloatLE(low[2] + height * (high[2] - low[2]) * 0.5, at + 8);
    bytes.writeFloatLE(1, at + 20);
    bytes.set([255 * u, 255 * v, 255 * height, [1, 2, 7, 8, 10][Math.floor(5 * u)]], at + 24);
    bytes.writeFloatLE(v, at + 28);
    bytes.writeUInt16LE(3, at + 32);
  }
  return bytes;
}
