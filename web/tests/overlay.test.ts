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
  const words = (levels: string[] | null, hasCharger: boolean) => {
    const clip = { alignment: levels && { alternatives: levels.map((level) => ({ level })) } } as unknown as Clip;
    return fake(overlayLegend(clip, hasCharger)).all("li").map((entry) => entry.textContent);
  };
  for (const [levels, hasCharger, wanted] of [
    [null, false, []], [["main"], false, []], [["main"], true, ["Charger of the robot"]],
    [["main", "main"], true, ["Another place of the clip", "Charger of the robot"]],
    // The picture has one level.
    [["main", "upper"], false, []], [["upper", "main", "upper"], false, ["Another place of the clip"]],
  ] as const) {
    assert.deepEqual(words(levels && [...levels], hasCharger).slice(4), wanted, String(levels));
  }
});
