// The page after a loss of the network, a stream or the session.
import assert from "node:assert/strict";
import { chooseFile, dropFiles } from "./page.mjs";

export function lossSteps({ page, base, go, file, shot }) {
  const home = `${base}/v1/homes/flat`;
  const problem = (status, detail) => ({
    status, contentType: "application/problem+json", body: JSON.stringify({ title: "Refused", status, detail }),
  });

  async function showHome() {
    await go("#/homes/flat");
    await page.getByRole("heading", { level: 1, name: "Flat" }).waitFor();
  }

  /** A phone needs seconds for the script on a slow network. */
  async function aSlowPageSaysThatItLoads() {
    const script = `${base}/assets/viewer-*.js`;
    let arrive = () => {};
    const arrived = new Promise((resolve) => (arrive = resolve));
    await page.route(script, (route) => arrived.then(() => route.continue()));
    await page.goto("about:blank");
    await page.goto(`${base}/#/homes/flat`, { waitUntil: "commit" });
    await page.locator("body > .loading").waitFor();
    arrive();
    await page.getByRole("heading", { level: 1, name: "Flat" }).waitFor();
    assert.equal(await page.locator("body > .loading").count(), 0);
    await page.unroute(script);
  }

  /** As while the service is upgraded behind a proxy. */
  async function aRefusedStreamIsOpenedAgain() {
    const events = `${home}/events`;
    let isRefused = true;
    await page.route(events, (route) => (isRefused ? route.fulfill({ status: 502, body: "" }) : route.continue()));
    const refused = page.waitForResponse((answer) => answer.url() === events && answer.status() === 502);
    await go("#/");
    await showHome();
    await refused;
    const opened = page.waitForResponse((answer) => answer.url() === events && answer.status() === 200);
    isRefused = false;
    await opened;
    await page.unroute(events);
  }

  /** An upload outlives its page, waits for the network, and sends only what the service lacks. */
  async function aBrokenUploadResumes() {
    const uploads = `${base}/v1/uploads**`;
    const [made, resumed] = [[], []];
    // One handler for all attempts: the browser tells nobody of a request that is sent between two handlers.
    let [isReached, isBroken] = [false, false];
    await page.route(uploads, (route) => {
      const request = route.request();
      const offset = request.headers()["upload-offset"] ?? "";
      if (request.method() === "POST") made.push(request.headers()["upload-metadata"]);
      else resumed.push(`${request.method()} ${offset}`.trim());
      // The second part breaks once.
      const breaks = isReached && !isBroken && Number(offset) > 0;
      isBroken ||= breaks;
      return isReached && !breaks ? route.continue() : route.abort();
    });
    const clip = await file("normal", "clip_0.zip");
    const files = ["first.zip", "next.zip"].map((name) => ({ name, bytes: clip.bytes }));
    await dropFiles(page, files);
    await page.locator(".uploads li", { hasText: "first.zip" }).getByText("waits for the service").waitFor();
    await page.locator(".uploads li", { hasText: "next.zip" }).getByText("waits", { exact: true }).waitFor();
    assert.equal(await page.locator(".uploads li.failed").count(), 0);
    await shot("14-upload-waits");
    await go("#/");
    await page.getByRole("heading", { level: 1, name: "Homes" }).waitFor();
    await showHome();
    isReached = true;
    await page.evaluate(() => dispatchEvent(new Event("online")));
    await page.waitForFunction(() => document.querySelectorAll(".uploads li").length === 0);
    await page.unroute(uploads);
    assert.ok(isBroken, "the file has one part only");
    assert.ok(made.length >= 3 && made[0] && made[0] === made[1], `the attempts to create the first upload: ${made}`);
    const part = resumed.find((request) => request.startsWith("PATCH") && request !== "PATCH 0");
    assert.deepEqual(resumed.slice(0, 5), ["HEAD", "PATCH 0", part, "HEAD", part]);
    await page.getByText("Same recording as first.zip").waitFor();
  }

  /** The page lists an upload that a reload interrupted, and continues it with the same file. */
  async function anInterruptedUploadContinues() {
    const uploads = `${base}/v1/uploads**`;
    const recording = { name: "kitchen.zip", bytes: (await file("normal", "clip_0.zip")).bytes };
    const offsets = [];
    let isBroken = true;
    await page.route(uploads, (route) => {
      const offset = Number(route.request().headers()["upload-offset"] ?? 0);
      if (route.request().method() === "PATCH") offsets.push(offset);
      return isBroken && offset > 0 ? route.abort() : route.continue();
    });
    await chooseFile(page, "#choose-clip", recording);
    await page.locator(".uploads li", { hasText: "kitchen.zip" }).getByText(/^waits for/).waitFor();
    // The browser asks a person who leaves unsent files.
    const leave = (dialog) => dialog.accept();
    page.on("dialog", leave);
    await page.reload();
    page.off("dialog", leave);
    const row = page.locator(".unfinished li", { hasText: "kitchen.zip" });
    await row.getByText("The upload was interrupted.").waitFor();
    await shot("14-upload-interrupted");
    [isBroken, offsets.length] = [false, 0];
    await chooseFile(page, ".unfinished input", recording);
    await row.waitFor({ state: "detached" });
    await page.waitForFunction(() => document.querySelectorAll(".uploads li").length === 0);
    assert.ok(offsets.length > 0 && offsets[0] > 0, `the parts begin at ${offsets}`);
    await page.unroute(uploads);
  }

  /** The walls behind the places of a clip, whose picture was lost on the way. */
  async function aLostPictureComesLater() {
    const { items: [clip] } = await (await page.request.get(`${base}/v1/homes/hotel/clips`)).json();
    let losses = 0;
    await page.route(/image\.png/, (route) => (losses++ < 2 ? route.abort() : route.continue()));
    await go(`#/homes/hotel/clips/${clip.id}`);
    await page.locator("[data-alternative] svg.plan image.picture[href]").first().waitFor({ state: "attached" });
    assert.ok(losses > 2, "no picture was lost");
    await page.unroute(/image\.png/);
  }

  /** The events of the home arrive before the answer to its deletion. */
  async function aDeletedHomeLeadsToTheList() {
    const gone = `${base}/v1/homes/gone`;
    await page.request.put(gone, { data: { name: "Gone" } });
    const opened = page.waitForResponse(`${gone}/events`);
    await go("#/homes/gone");
    await opened;
    await page.route(gone, async (route) => {
      if (route.request().method() !== "DELETE") return route.continue();
      const answer = await route.fetch();
      await page.getByRole("heading", { name: "This is not here" }).waitFor();
      await route.fulfill({ response: answer });
    });
    await page.getByRole("button", { name: "Delete home" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Delete home" }).click();
    await page.getByRole("heading", { level: 1, name: "Homes" }).waitFor();
    await page.unroute(gone);
  }

  /** A tab that is looked at again after the session's end. */
  async function anEndedSessionAsksForAKey() {
    await showHome();
    await page.getByRole("button", { name: "Rename home" }).click();
    await page.getByRole("dialog").waitFor();
    const all = `${home}**`;
    await page.route(all, (route) => route.fulfill(problem(401, "the session has ended; sign in again")));
    await page.evaluate(() => document.dispatchEvent(new Event("visibilitychange")));
    await page.getByRole("heading", { name: "This service asks for a key" }).waitFor();
    assert.equal(await page.getByRole("dialog").count(), 0, "the question of the page before lies over the form");
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-label")), "Key");
    await shot("14-session-ended");
    await page.unroute(all);
  }

  return [
    aSlowPageSaysThatItLoads, aRefusedStreamIsOpenedAgain, aBrokenUploadResumes, anInterruptedUploadContinues, aLostPictureComesLater,
    aDeletedHomeLeadsToTheList, anEndedSessionAsksForAKey,
  ];
}
