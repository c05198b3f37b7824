import { body, fake, until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { ClipCloud } from "../src/clip/cloud.ts";
import type { Clip } from "../src/types.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));

test("the button of the points rests until they are on their way: a second press would load them twice", async () => {
  let answer = (_: Response) => {};
  globalThis.fetch = () => new Promise((resolve) => (answer = resolve));
  const cloud = new ClipCloud(new AbortController().signal, () => {});
  body.replaceChildren(fake(cloud.element));
  cloud.show({ home: "h", id: "c", reasons: [], alignment: { labels: null, hits: 9 } } as unknown as Clip);
  const button = () => fake(cloud.element).all("button")[0];
  button()?.dispatchEvent(new Event("click"));
  assert.equal(button()?.getAttribute("aria-disabled"), "true");
  // Node.js has no WebGL: the reason is told, and a person may try again.
  answer(new Response(JSON.stringify({ classes: [] })));
  await until(() => button()?.textContent === "Try again");
  assert.equal(button()?.getAttribute("aria-disabled"), null);
});
