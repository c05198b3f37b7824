import assert from "node:assert/strict";
import { test } from "node:test";
import { arrange, type Label, shortened } from "../src/parts/labels.ts";

const label = (x: number, y: number): Label => ({ x, y, width: 40, height: 10 });

test("labels at one place are stacked, and those without room are left out", () => {
  assert.deepEqual(arrange([label(0, 0), label(0, 0), label(0, 0), label(0, 0)]), [0, -10, 10, null]);
});

test("no two labels that are shown overlap", () => {
  const labels = Array.from({ length: 60 }, (_, i) => label((i * 37) % 200, (i * 53) % 120));
  const shifts = arrange(labels);
  const shown = labels.flatMap((one, i) => (shifts[i] === null ? [] : [{ ...one, y: one.y + (shifts[i] ?? 0) }]));
  assert.ok(shown.length > 10);
  shown.forEach((a, i) => shown.slice(i + 1).forEach((b) =>
    assert.ok(Math.abs(a.x - b.x) >= 40 || Math.abs(a.y - b.y) >= 10, `${JSON.stringify([a, b])} overlap`)));
});

test("labels apart stay where they are, and one that is out takes no room", () => {
  assert.deepEqual(arrange([label(0, 0), null, label(50, 0), label(0, 12)]), [0, null, 0, 0]);
});

test("a text that is too wide is cut", () => {
  // Without a canvas every letter has 7 pixels.
  Object.assign(globalThis, { document: { createElement: () => ({ getContext: () => null }) } });
  for (const [text, cut] of [["Sofa", "Sofa"], ["0123456789", "0123456789"], ["0123456789a", "012345678…"], ["0123456  abc", "0123456…"]] as const) {
    assert.equal(shortened(text, "400 11px", 70), cut);
  }
});
