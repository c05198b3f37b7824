import assert from "node:assert/strict";
import { test } from "node:test";
import { clustered } from "../src/cloud/coarse.ts";

/** A square of n x n cells of 1 m, two triangles each; a vertex has two more numbers than its place. */
function plane(n: number): { positions: Float32Array; indices: number[] } {
  const places = Array.from({ length: (n + 1) ** 2 }, (_, i) => [i % (n + 1), Math.floor(i / (n + 1)), 0, 7, 7]).flat();
  const indices: number[] = [];
  for (let y = 0; y < n; y++) {
    for (let x = 0; x < n; x++) {
      const a = y * (n + 1) + x;
      indices.push(a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1);
    }
  }
  return { positions: new Float32Array(places), indices };
}

test("a plane keeps its area with a quarter of the triangles", () => {
  const { positions, indices } = plane(8);
  const coarse = clustered(positions, 5, indices, 2);
  assert.equal(coarse.length, indices.length / 4);
  let area = 0;
  for (let i = 0; i < coarse.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((corner) => 5 * (coarse[i + corner] ?? 0)) as [number, number, number];
    const at = (vertex: number, axis: number) => positions[vertex + axis] ?? 0;
    area += ((at(b, 0) - at(a, 0)) * (at(c, 1) - at(a, 1)) - (at(c, 0) - at(a, 0)) * (at(b, 1) - at(a, 1))) / 2;
  }
  // The far edge moves to the first vertices of its cells, which are on it.
  assert.equal(area, 64);
});

test("cells on both sides of zero are different ones", () => {
  const positions = new Float32Array([-1, 0, 0, 1, 0, 0, 0, 5, 0]);
  assert.deepEqual([...clustered(positions, 3, [0, 1, 2], 3)], [0, 1, 2]);
  assert.deepEqual([...clustered(positions, 3, [0, 1, 2], 100)], []);
});
