import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { overlayInWords } from "../src/clip/overlay.ts";
import type { Clip } from "../src/types.ts";

const wordsOf = (levels: string[] | null) =>
  overlayInWords({ alignment: levels && { alternatives: levels.map((level) => ({ level })) } } as unknown as Clip);

test("the words for the picture have the colours of the picture", () => {
  // `npm test` runs in `web/`.
  const source = readFileSync(join(process.cwd(), "../crates/viola-home/src/picture.rs"), "utf8");
  for (const [name, word, ink] of [
    ["MATCHED", "green where a wall", [22, 163, 74]], ["UNMATCHED", "red where none", [220, 38, 38]],
    ["CAMERA", "path is blue", [37, 99, 235]], ["ALTERNATIVE", "places of the clip are orange", [234, 88, 12]],
  ] as const) {
    assert.ok(source.includes(`const ${name}: [u8; 4] = [${ink.join(", ")}, 255];`), `${name} is ${ink}`);
    assert.ok(wordsOf(["main", "main"]).includes(word), word);
  }
});

test("the words name other places only if the picture has some", () => {
  // The picture has one level.
  for (const [levels, hasOthers] of [
    [null, false], [["main"], false], [["main", "main"], true], [["main", "upper"], false], [["upper", "main", "upper"], true],
  ] as const) {
    assert.equal(wordsOf(levels && [...levels]).includes("orange"), hasOthers, String(levels));
  }
});
