// A page of another origin uploads by tus-js-client and reads the answers, in Chromium. `tests/browser` starts it with the
// server's address, that of the page, a home and the clip's file, and reads a line of JSON.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { chromium } from "playwright-core";

const { VIOLA_BASE: base, VIOLA_PAGE: address, VIOLA_HOME: home, VIOLA_FILE: path } = process.env;
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });

const page = await browser.newPage();
await page.goto(address);
await page.addScriptTag({ path: "node_modules/tus-js-client/dist/tus.js" });
const base64 = (await readFile(path)).toString("base64");
const told = await page.evaluate(async ({ base, home, base64 }) => {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  await fetch(`${base}/v1/homes/${home}`, { method: "PUT" });
  const offsets = [];
  const clip = await new Promise((resolve, reject) => {
    new globalThis.tus.Upload(new Blob([bytes]), {
      endpoint: `${base}/v1/uploads`,
      metadata: { home, filename: "clip.zip", title: "From another page" },
      chunkSize: 1000,
      retryDelays: null,
      onAfterResponse: (_, answer) => { offsets.push(answer.getHeader("Upload-Offset")); },
      onError: reject,
      onSuccess: ({ lastResponse }) => resolve(lastResponse.getHeader("Viola-Clip")),
    }).start();
  });
  const answer = await fetch(`${base}${clip}`);
  const recording = await fetch(`${base}${clip}/recording`);
  const refusal = await fetch(`${base}/v1/homes/none`);
  return {
    offsets,
    clip: await answer.json(),
    tag: answer.headers.get("etag"),
    name: recording.headers.get("content-disposition"),
    refusal: (await refusal.json()).type,
  };
}, { base, home, base64 });
assert.ok(told.offsets.length > 2 && told.offsets.every((offset) => offset !== null), told.offsets.join());
assert.ok(told.tag, "the page reads the entity tag");
assert.equal(told.name, 'attachment; filename="clip.zip"');
assert.equal(told.refusal, "urn:viola:problem:home-not-found");

// The same page under a name that the service was not told may not read anything.
await page.goto(address.replace("127.0.0.1", "localhost"));
const refused = await page.evaluate((base) => fetch(`${base}/v1/homes`).then(() => "read", (error) => error.name), base);
assert.equal(refused, "TypeError");
await browser.close();
console.log(JSON.stringify({ sha256: told.clip.sha256, title: told.clip.title, file_name: told.clip.file_name }));
