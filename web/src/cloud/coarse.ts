// A coarser copy of a mesh's triangles over the same vertices, for machines that are slow while the view moves.

/**
 * Returns the indices of the triangles between cells of a grid: every vertex becomes the first one of its cell
 * (Rossignac and Borrel, 1993), and triangles within one or two cells go.
 */
export function clustered(positions: ArrayLike<number>, stride: number, indices: ArrayLike<number>, cell: number): Uint32Array {
  const first = new Map<number, number>();
  const count = Math.floor(positions.length / stride);
  const cellOf = new Uint32Array(count);
  for (let i = 0; i < count; i++) {
    // 17 bits for each axis are exact in a double, and 13 km at 10 cm.
    const at = (axis: number) => Math.floor((positions[stride * i + axis] ?? 0) / cell) & 0x1ffff;
    const key = (at(0) * 0x20000 + at(1)) * 0x20000 + at(2);
    const known = first.get(key);
    if (known === undefined) first.set(key, i);
    cellOf[i] = known ?? i;
  }
  const kept: number[] = [];
  for (let i = 0; i + 2 < indices.length; i += 3) {
    const [a, b, c] = [cellOf[indices[i] ?? 0] ?? 0, cellOf[indices[i + 1] ?? 0] ?? 0, cellOf[indices[i + 2] ?? 0] ?? 0];
    if (a !== b && b !== c && c !== a) kept.push(a, b, c);
  }
  return new Uint32Array(kept);
}
