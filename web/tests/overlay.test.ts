import { fake } from "./dom.ts";
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { INKS, overlayLegend } from "../src/clip/overlay.ts";
import type { Clip } from "../src/types.ts";

test("the legend of the picture has the colours of the picture", () => {
  // `npm test` runs in `web/`.
  const source = readFileSync(join(process.cwd(), "../crates/viola-home/src/picture.rs"), "utf8");
  for (const [name, ink] of Object.entries(INKS)) {
    assert.ok(source.includes(`const ${name}: [u8; 4] = [${ink.join(", ")}, 255];`), `${name} is ${ink}`);
  }
});

test("the legend names what the picture has", () => {
  const words = (places: number, hasCharger: boolean) => {
    const clip = { alignment: { alternatives: Array.from({ length: places }) } } as unknown as Clip;
    return fake(overlayLegend(clip, hasCharger)).all("li").map((entry) => entry.textContent);
  };
  assert.deepEqual([words(1, false).length, words(2, true).length], [4, 6]);
  assert.ok(!words(1, true).includes("Another place of the clip") && words(1, true).includes("Charger of the robot"));
});
