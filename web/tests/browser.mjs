// Drives the real page in Chromium over a real server, as a person would. `tests/browser.rs` starts it with the
// server's address, the recordings and a folder for the pictures; every wait is for a condition.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { chromium } from "playwright-core";
import { cloudOf } from "./browser/cloud.mjs";
import { fileSteps } from "./browser/files.mjs";
import { homeSteps } from "./browser/home.mjs";
import { lossSteps } from "./browser/losses.mjs";
import { aSmallPhoneHasAPlan, aTurnedPhoneShowsTheHomeWhole, boxOf, dropFiles, isResponsive, recordProgress, theLegendLiesBelowThePlan } from "./browser/page.mjs";
import { placeSteps } from "./browser/places.mjs";
import { surfaceSteps } from "./browser/surface.mjs";

const { VIOLA_BASE: base, VIOLA_RECORDINGS: recordings, VIOLA_PICTURES: pictures } = process.env;
/** An upload with its job takes seconds; a busy machine with two cores takes longer. */
const DEADLINE_MS = 180_000;
/** Input waits at most so long for a million points that are drawn by software. */
const RESPONSIVE_MS = 200;
const MILLION = 1_000_000;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, colorScheme: "light" });
context.setDefaultTimeout(DEADLINE_MS);
await context.grantPermissions(["clipboard-read", "clipboard-write"]);
const page = await context.newPage();
const foreign = [];
const wrong = [];
page.on("request", (request) => {
  const { protocol, origin } = new URL(request.url());
  if (!["blob:", "data:"].includes(protocol) && origin !== base) foreign.push(request.url());
});
page.on("pageerror", (error) => wrong.push(String(error)));
page.on("console", (message) => {
  // The browser itself writes down every answer of 404, and those are allowed.
  if (message.type() === "error" && !message.text().startsWith("Failed to load resource")) wrong.push(message.text());
});

const shot = (name) => page.screenshot({ path: join(pictures, `${name}.png`), animations: "disabled" });
const say = (text) => console.log(text);
const go = (hash) => page.goto(`${base}/${hash}`);
const file = async (folder, name) => ({ name, bytes: await readFile(join(recordings, folder, name)) });
const open = async (path) => (await page.request.get(`${base}${path}`)).json();
const clipRow = (state) => page.locator(`li.clip.${state}`).first();

/** The page makes the id `flat` of the name `Flat`. */
async function makeHome(name) {
  await go("#/");
  await page.getByLabel("Name of the new home").fill(name);
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { level: 1, name }).waitFor();
  assert.equal(await page.evaluate(() => location.hash), `#/homes/${name.toLowerCase()}`);
}

async function pointsShown(count) {
  await page.waitForFunction((count) => {
    const shown = Number(document.querySelector(".views")?.dataset.points ?? 0);
    return count === null ? shown > 0 : shown === count;
  }, count ?? null);
}

async function anEmptyServerHelps() {
  await go("");
  await page.getByRole("heading", { name: "No home yet" }).waitFor();
  await shot("01-no-home");
  await makeHome("Flat");
  await page.getByRole("heading", { name: "This home is empty" }).waitFor();
  await shot("02-empty-home");
  await go("#/");
  await page.locator(".home-card", { hasText: "Add the LiDAR map of the robot vacuum" }).click();
  await page.getByRole("heading", { name: "This home is empty" }).waitFor();
}

async function filesAreDroppedAndFollowed() {
  await recordProgress(page);
  await dropFiles(page, [await file("normal", "clip_0.zip"), await file("normal", "valetudo.json")]);
  await clipRow("aligned").waitFor();
  const seen = await page.evaluate(() => globalThis.progressSeen);
  assert.ok(seen.uploads.some((name) => name.includes("clip_0.zip")), `uploads seen: ${seen.uploads}`);
  assert.ok(seen.uploads.some((name) => name.includes("valetudo.json")), `uploads seen: ${seen.uploads}`);
  assert.ok(seen.stages.length > 1, `stages seen: ${seen.stages}`);
  say(`progress of the job: ${seen.stages.join(" | ")}`);
  await page.locator("label[for=choose-clip]").waitFor();
  await page.waitForFunction(() => document.querySelectorAll(".uploads li").length === 0);
}

async function pointsAreColoured() {
  await page.locator(".views[data-revision]").waitFor({ state: "attached" });
  await page.locator("#view-3d").check({ force: true });
  await pointsShown();
  const place = await boxOf(page.locator(".stage-3d"));
  for (const colouring of ["class", "clip", "probability", "colour"]) {
    await page.locator(`#colouring-${colouring}`).check({ force: true });
    await page.locator(`.views[data-colouring=${colouring}]`).waitFor();
    assert.equal(await page.locator(".legend").isVisible(), ["class", "probability"].includes(colouring));
    assert.deepEqual(await boxOf(page.locator(".stage-3d")), place, "the legend moves the picture");
    await page.locator(".stage").screenshot({ path: join(pictures, `03-3d-${colouring}.png`) });
  }
  // By keyboard, as radio buttons are.
  await page.locator("#colouring-colour").focus();
  await page.keyboard.press("ArrowRight");
  await page.locator(".views[data-colouring=class]").waitFor();
  const wall = page.locator(".classes input[data-name=wall]");
  await wall.uncheck();
  await page.locator(".stage").screenshot({ path: join(pictures, "04-3d-without-walls.png") });
  await wall.check();
  await page.locator("#view-2d").check({ force: true });
  await page.locator("svg.plan image.points[href]").waitFor({ state: "attached" });
  await theLegendLiesBelowThePlan(page);
  await shot("05-2d");
  const before = await page.locator("svg.plan").first().getAttribute("viewBox");
  await page.locator("svg.plan").first().focus();
  await page.keyboard.press("+");
  assert.notEqual(await page.locator("svg.plan").first().getAttribute("viewBox"), before);
  await page.keyboard.press("0");
  await page.locator("#view-3d").check({ force: true });
}

async function themesAndPhones() {
  for (const theme of ["light", "dark"]) {
    await page.getByRole("button", { name: /Theme/ }).click();
    assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), theme);
    await page.locator(`.views[data-ink=${theme}]`).waitFor();
    await page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
    await shot(`07-home-${theme}`);
  }
  await page.setViewportSize({ width: 390, height: 844 });
  for (const hash of ["#/", "#/homes/flat", await clipHash("flat")]) {
    await go(hash);
    await page.locator("main h1").waitFor();
    if (hash === "#/homes/flat") {
      await pointsShown();
      await page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
      await theCardLiesBelowTheMap();
      // The card belonged to a room, and the view flew to it.
      await aTurnedPhoneShowsTheHomeWhole(page);
    }
    const name = `08-phone-${hash.replaceAll(/[^a-z]+/g, "-").slice(1, 14) || "homes"}`;
    await shot(name);
    await page.screenshot({ path: join(pictures, `${name}-whole.png`), animations: "disabled", fullPage: true });
    for (const px of [320, 360, 390]) {
      await page.setViewportSize({ width: px, height: 844 });
      await theBreadcrumbCanBeHit();
      const width = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(width <= px, `${hash} is ${width} px wide on a phone of ${px} px`);
    }
  }
  await page.setViewportSize({ width: 1280, height: 800 });
  await go("#/homes/flat");
  await pointsShown();
  const beyond = await page.evaluate(() => {
    const [whole, side] = [document.documentElement, document.querySelector(".side")];
    return [whole.scrollWidth - whole.clientWidth, whole.scrollHeight - whole.clientHeight, side.scrollWidth - side.clientWidth];
  });
  assert.deepEqual(beyond, [0, 0, 0], "the home's page scrolls only in its side panel, and only down");
  await page.getByRole("button", { name: /Theme/ }).click();
}

/** Also on the page of a clip with a long name. */
async function theBreadcrumbCanBeHit() {
  const widths = await page.evaluate(() => {
    document.querySelector(".crumbs [aria-current]").textContent = "long name ".repeat(20);
    return [...document.querySelectorAll(".crumbs a")].map((link) => link.getBoundingClientRect().width);
  });
  assert.ok(widths.every((width) => width >= 24), `the links are ${widths} px wide`);
}

async function theCardLiesBelowTheMap() {
  const [map, figures] = [await boxOf(page.locator(".views")), await boxOf(page.locator(".stage-foot"))];
  assert.ok(map.y + map.height <= figures.y, "the figures cover the map");
  await page.locator(".thing-row").first().click();
  const [views, card] = [await boxOf(page.locator(".views")), await boxOf(page.locator(".details"))];
  assert.ok(views.y + views.height <= card.y, "the card covers the selected object");
  await page.locator("label:has(#view-2d)").click();
  await page.waitForFunction(() => {
    const [tools, plan] = [".toolbar", ".views > .plan"].map((name) => document.querySelector(name).getBoundingClientRect());
    return tools.bottom <= plan.top;
  });
  await theLegendLiesBelowThePlan(page);
  await aSmallPhoneHasAPlan(page);
  await page.locator("label:has(#view-3d)").click();
  // A measurement has the whole map.
  await page.getByRole("button", { name: "Measure" }).click();
  await page.locator(".details").waitFor({ state: "hidden" });
  await page.locator(".stage-foot").waitFor({ state: "hidden" });
  const [stage, measured] = [await boxOf(page.locator(".stage")), await boxOf(page.locator(".views"))];
  assert.equal(measured.height, stage.height);
  await page.locator(".measure").getByRole("button", { name: "Done" }).click();
  await page.locator(".details").getByRole("button", { name: "Close" }).click();
}

async function clipHash(home) {
  const { items } = await open(`/v1/homes/${home}/clips`);
  return `#/homes/${home}/clips/${items[0].id}`;
}

async function anAlternativeIsChosen() {
  await makeHome("Hotel");
  await dropFiles(page, [await file("repeated", "valetudo.json"), await file("repeated", "clip_0.zip")]);
  await clipRow("ambiguous").waitFor();
  await shot("09-ambiguous-home");
  await clipRow("ambiguous").getByRole("link").click();
  const places = page.locator("[data-alternative]");
  await places.nth(1).waitFor();
  assert.ok((await places.count()) > 1);
  await page.locator("svg.plan image.picture[href]").first().waitFor({ state: "attached" });
  await shot("10-alternatives");
  await page.getByRole("button", { name: "Find its place again" }).waitFor();
  assert.equal(await page.getByRole("button", { name: "Stop", exact: true }).count(), 0, "a settled clip has a job to stop");
  await page.getByRole("button", { name: "Rename" }).click();
  await page.getByRole("dialog").getByRole("textbox").fill("Corridor");
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { level: 1, name: "Corridor" }).waitFor();
  for (const word of ["Download the recording", "Download the points"]) {
    const answer = await page.request.get(base + (await page.getByRole("link", { name: word }).getAttribute("href")));
    assert.ok(answer.ok() && (await answer.body()).length > 100, `${word}: ${answer.status()}`);
  }
  // Points that fail have a reason, and another try.
  await page.route(/cloud\.ply/, (route) => route.fulfill({ status: 404, body: "" }));
  await page.getByRole("button", { name: "Show the clip's points" }).click();
  await page.getByText("The clip has no points yet.").waitFor();
  await page.unroute(/cloud\.ply/);
  await page.getByRole("button", { name: "Try again" }).click();
  await page.locator(".stage-facts", { hasText: "points" }).waitFor();
  await page.getByRole("button", { name: "Choose place 2" }).click();
  await anImprobablePlaceAsksAgain();
  await page.locator(".head .badge.aligned").waitFor();
  await page.locator("[data-alternative='1'].chosen").waitFor();
  await page.locator(".reasons", { hasText: /^a person chose place 2/ }).waitFor();
  // The other places are folded away.
  await page.getByRole("heading", { name: "Its place: place 2" }).waitFor();
  assert.equal(await page.locator("[data-alternative]:visible").count(), 1);
  await shot("11-chosen");
  await page.getByRole("button", { name: "Withdraw choice" }).click();
  await page.locator(".head .badge.ambiguous").waitFor();
  // A closed question gives the focus back to its button.
  await page.getByRole("button", { name: "Delete clip" }).focus();
  await page.keyboard.press("Enter");
  await page.getByRole("dialog").waitFor();
  await page.keyboard.press("Escape");
  await page.getByRole("dialog").waitFor({ state: "detached" });
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Delete clip");
}

/** A clip of rooms that look alike has places that are hardly probable: such a choice is confirmed. */
async function anImprobablePlaceAsksAgain() {
  const { items: [{ alignment, reasons }] } = await open("/v1/homes/hotel/clips");
  const advice = await page.locator(".verdict .advice").allTextContents();
  assert.equal(advice.length, 1, `the advice is told more than once: ${advice}`);
  assert.ok(reasons.some(({ code }) => code === "several_modes"));
  assert.ok(!/film more/i.test(await page.locator(".verdict .reasons").textContent()), "the reason repeats the advice");
  const probabilities = alignment.alternatives.map(({ probability }) => probability);
  const together = probabilities.reduce((sum, probability) => sum + probability, 0);
  if (Math.max(...probabilities) >= 0.5 && together >= 0.7 && probabilities[1] >= 0.2) return;
  const doubt = together < 0.7 ? "The clip may be of another home." : "Another place may be the right one.";
  await page.getByRole("dialog").getByText(doubt).waitFor();
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Cancel");
  await page.getByRole("dialog").getByRole("button", { name: "Choose place 2" }).click();
}

async function homesAreSearched() {
  // As a person types it, without the `#`.
  await page.goto(`${base}/homes/hotel`);
  await page.getByRole("heading", { level: 1, name: "Hotel" }).waitFor();
  await go("#/");
  await page.getByRole("link", { name: /^Hotel .*1 unclear.*1 clip has no certain place: choose it/ }).waitFor();
  assert.equal(await page.locator(".home-card").first().getAttribute("data-key"), "hotel", "the home that needs attention is not the first");
  await dropFiles(page, [{ name: "clip.zip", bytes: Buffer.alloc(1) }]);
  await page.getByText("Open a home to add files.").waitFor();
  await page.getByLabel("Search homes").fill("HOT");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.querySelectorAll(".home-card").length === 1);
  await page.getByLabel("Only homes that need attention").check();
  await page.waitForFunction(() => location.hash === "#/?q=HOT&needs_attention=true");
  await page.getByRole("link", { name: /^Hotel/ }).waitFor();
  await shot("11-homes");
  await go("#/?q=nothing");
  await page.getByRole("heading", { name: "No home like this" }).waitFor();
  await page.getByRole("link", { name: "All homes" }).click();
  await page.getByRole("link", { name: /^Flat/ }).waitFor();
  await page.waitForFunction(() => document.querySelectorAll(".home-card").length === 2);
}

/** Switches, turns and walks, as fast as the page takes it. */
async function touchEverything(colourings = ["class", "clip", "probability", "colour"]) {
  const stage = await boxOf(page.locator(".stage-3d canvas"));
  const [x, y] = [stage.x + stage.width / 2, stage.y + stage.height / 2];
  for (const colouring of colourings) await page.locator(`label:has(#colouring-${colouring})`).click();
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let step = 1; step <= 20; step++) await page.mouse.move(x + 12 * step, y);
  await page.mouse.up();
  await page.locator(".stage-3d canvas").focus();
  for (const key of ["ArrowLeft", "ArrowUp", "+", "w"]) await page.keyboard.press(key);
}

/** The service shares its two cores with this browser, and has maps to merge for a while. */
async function serviceRests() {
  const deadline = performance.now() + DEADLINE_MS;
  for (;;) {
    const { queued, running, merges_due } = await open("/readyz");
    if (queued + running + merges_due === 0) return;
    assert.ok(performance.now() < deadline, "the service is still at work");
    await page.waitForTimeout(200);
  }
}

async function aMillionPointsStayResponsive() {
  await serviceRests();
  const { info } = await open("/v1/homes/flat/map");
  const cloud = cloudOf(MILLION, info.min_m, info.max_m);
  await page.route(/\/map\/points/, (route) => route.fulfill({ body: cloud, contentType: "model/ply" }));
  await go("#/homes/flat");
  await page.reload();
  await pointsShown(MILLION);
  await page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
  const isShown = () => page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
  say("a million points");
  await isResponsive(page, { act: () => touchEverything(), isShown, limit_ms: RESPONSIVE_MS, say });
  await page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
  await page.locator(".stage").screenshot({ path: join(pictures, "12-million.png") });
  await page.unroute(/\/map\/points/);
}

async function aClipIsDeletedByKeyboard() {
  await go("#/homes/flat");
  await clipRow("aligned").waitFor();
  await page.getByRole("button", { name: "Delete clip_0.zip" }).focus();
  await page.keyboard.press("Enter");
  const dialog = page.getByRole("dialog");
  await dialog.waitFor();
  // The harmless answer has the focus, and Escape is one too.
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Cancel");
  await page.keyboard.press("Escape");
  await dialog.waitFor({ state: "detached" });
  assert.equal(await page.locator("li.clip").count(), 1);
  await page.getByRole("button", { name: "Delete clip_0.zip" }).focus();
  await page.keyboard.press("Enter");
  await dialog.waitFor();
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.querySelectorAll("li.clip").length === 0);
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Clips", "the focus is lost with the row");
  assert.deepEqual((await open("/v1/homes/flat/clips")).items, []);
  await shot("13-deleted");
}

async function aBrowserWithoutWebGlShowsThePlan() {
  const poor = await context.newPage();
  await poor.addInitScript(() => {
    const getContext = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
      return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...rest);
    };
  });
  await poor.goto(`${base}/#/homes/flat`);
  await poor.locator("svg.plan image.points[href]").waitFor({ state: "attached" });
  assert.equal(await poor.locator("#view-3d").count(), 0);
  await poor.close();
}

async function aLostServerIsTold() {
  await page.route(/\/v1\//, (route) => route.abort());
  await go("#/");
  await page.getByRole("heading", { name: "This cannot be shown" }).waitFor();
  await shot("14-lost");
  // Nobody presses "Try again".
  await page.unroute(/\/v1\//);
  await page.getByRole("link", { name: /^Flat/ }).waitFor();
}

try {
  const ofAHome = homeSteps({ browser, context, page, base, open, shot, serviceRests });
  const steps = [
    anEmptyServerHelps, filesAreDroppedAndFollowed, pointsAreColoured, ...ofAHome,
    ...surfaceSteps({ page, open, say, pictures, touchEverything, serviceRests }), ...fileSteps({ page, open, file, say, shot }), themesAndPhones,
    anAlternativeIsChosen, homesAreSearched, ...placeSteps({ page, base, makeHome, file, go, open, shot, pointsShown }), aMillionPointsStayResponsive,
    aBrowserWithoutWebGlShowsThePlan, aClipIsDeletedByKeyboard, ...lossSteps({ page, base, go, file, shot }), aLostServerIsTold,
  ];
  for (const step of steps) {
    const begun = performance.now();
    await step();
    say(`${step.name}: ${((performance.now() - begun) / 1000).toFixed(1)} s`);
  }
  assert.deepEqual(foreign, [], "a request left the host");
  assert.deepEqual(wrong, [], "the page reported errors");
} catch (error) {
  await shot("99-failed").catch(() => {});
  console.error(`${error.stack}\non the page: ${wrong.join("\n")}`);
  process.exitCode = 1;
} finally {
  await browser.close();
}
