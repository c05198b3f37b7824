// The page after a loss of the network, a stream or the session.
import assert from "node:assert/strict";
import { dropFiles } from "./page.mjs";

export function lossSteps({ page, base, go, file, shot }) {
  const home = `${base}/v1/homes/flat`;
  const problem = (status, detail) => ({
    status, contentType: "application/problem+json", body: JSON.stringify({ title: "Refused", status, detail }),
  });

  async function showHome() {
    await go("#/homes/flat");
    await page.getByRole("heading", { level: 1, name: "Flat" }).waitFor();
  }

  /** As while the service is upgraded behind a proxy. */
  async function aRefusedStreamIsOpenedAgain() {
    const events = `${home}/events`;
    await page.route(events, (route) => route.fulfill({ status: 502, body: "" }));
    const refused = page.waitForResponse((answer) => answer.url() === events && answer.status() === 502);
    await go("#/");
    await showHome();
    await refused;
    const opened = page.waitForResponse((answer) => answer.url() === events && answer.status() === 200);
    await page.unroute(events);
    await opened;
  }

  /** An upload outlives its page, and a clip that arrived is not stored twice. */
  async function aBrokenUploadIsTriedAgain() {
    const clips = `${home}/clips`;
    const keys = [];
    page.on("request", (request) => {
      if (request.method() === "POST" && request.url() === clips) keys.push(request.headers()["idempotency-key"]);
    });
    await page.route(clips, (route) => (route.request().method() === "POST" ? route.abort() : route.continue()));
    await dropFiles(page, [await file("normal", "clip_0.zip")]);
    const row = page.locator(".uploads li.failed");
    await row.waitFor();
    await shot("14-upload-broke");
    await go("#/");
    await page.getByRole("heading", { level: 1, name: "Homes" }).waitFor();
    await showHome();
    await page.unroute(clips);
    await row.getByRole("button", { name: "Try again" }).click();
    await page.waitForFunction(() => document.querySelectorAll(".uploads li").length === 0);
    assert.ok(keys.length === 2 && keys[0] && keys[0] === keys[1], `the keys of one file: ${keys}`);
  }

  /** A tab that is looked at again after the session's end. */
  async function anEndedSessionAsksForAKey() {
    await showHome();
    const all = `${home}**`;
    await page.route(all, (route) => route.fulfill(problem(401, "the session has ended; sign in again")));
    await page.evaluate(() => document.dispatchEvent(new Event("visibilitychange")));
    await page.getByRole("heading", { name: "This service asks for a key" }).waitFor();
    await shot("14-session-ended");
    await page.unroute(all);
  }

  return [aRefusedStreamIsOpenedAgain, aBrokenUploadIsTriedAgain, anEndedSessionAsksForAKey];
}
