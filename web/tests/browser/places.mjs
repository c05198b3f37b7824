// The steps of a person in homes of several storeys, and with a clip of another home.
import assert from "node:assert/strict";
import { dropFiles } from "./page.mjs";

/** The walls of a room of 3 x 2 m, which no recording shows. */
function smallRoom() {
  const lines = ["x,y"];
  for (let x = 0; x <= 3; x += 0.02) lines.push(`${x.toFixed(2)},0.00`, `${x.toFixed(2)},2.00`);
  for (let y = 0; y <= 2; y += 0.02) lines.push(`0.00,${y.toFixed(2)}`, `3.00,${y.toFixed(2)}`);
  return Buffer.from(lines.join("\n"));
}

export function placeSteps({ page, base, makeHome, file, go, open, shot, pointsShown }) {
  async function put(path, data) {
    const answer = await page.request.put(`${base}${path}`, { data, headers: { "content-type": "application/octet-stream" } });
    assert.ok(answer.ok(), `${path}: ${answer.status()}`);
  }

  /** The thumbnail has arrived, and is as large as the service says. */
  async function hasThumbnail(locator) {
    await locator.scrollIntoViewIfNeeded();
    const side = await locator.evaluate(async (image) => {
      await image.decode();
      return Math.max(image.naturalWidth, image.naturalHeight);
    });
    assert.ok(side > 100 && side <= 320, `the thumbnail has ${side} pixels`);
  }

  async function aLevelIsChosen() {
    await makeHome("House");
    await put("/v1/homes/house/lidar-maps/main", smallRoom());
    await put("/v1/homes/house/lidar-maps/upper", (await file("normal", "valetudo.json")).bytes);
    await dropFiles(page, [await file("normal", "clip_0.zip")]);
    // A map of points knows no free floor, so the small room may remain a rival: a person decides.
    await page.locator("li.clip:is(.aligned, .ambiguous)").waitFor();
    const { items: [{ id, alignment }] } = await open("/v1/homes/house/clips");
    const alternative = alignment.alternatives.findIndex(({ level }) => level === "upper");
    const chosen = await page.request.put(`${base}/v1/homes/house/clips/${id}/alignment`, { data: { alternative } });
    assert.ok(chosen.ok(), `the choice was answered with ${chosen.status()}`);
    const clip = page.locator("li.clip.aligned");
    await clip.getByText("upper").waitFor();
    await page.locator(".views[data-level=main]").waitFor();
    const level = page.getByLabel("Level");
    assert.deepEqual(await level.locator("option").allTextContents(), ["Main", "Upper"]);
    // The clip is of the other level, so this one has no points and no rooms of the map.
    assert.equal(await page.locator(".classes .switch").count(), 0);
    await theOldPlanGoesAtOnce(level);
    await page.locator("label:has(#view-3d)").click();
    await pointsShown();
    await page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
    await shot("15-level");
    const names = await page.locator(".thing-row").allTextContents();
    assert.ok(!names.some((name) => name.includes("~")), `the names have the level: ${names}`);
    await page.waitForFunction(() => location.hash.includes("level=upper"));
    // The choice makes a new revision; the page follows, sooner or later than this test asks.
    await page.waitForFunction(async () => {
      const { levels } = await (await fetch("/v1/homes/house/map")).json();
      const upper = levels.find(({ level }) => level === "upper");
      return document.querySelector(".views").dataset.points === String(upper.info.points);
    });
    await aRoomIsOpenedByItsAddress();
    // Its files are those of the level that is shown.
    await page.locator("summary", { hasText: "Downloads" }).click();
    assert.match(await page.locator(".downloads a", { hasText: "Floor plan to print" }).getAttribute("href"), /level=upper/);
    await hasThumbnail(clip.locator("img"));
    await level.selectOption("main");
    await page.locator(".views[data-level=main]").waitFor();
  }

  /** While the picture of another level is on its way, that of the level before does not lie under its name. */
  async function theOldPlanGoesAtOnce(level) {
    const picture = page.locator(".views svg.plan image.picture");
    await page.locator("label:has(#view-2d)").click();
    await page.locator(".views svg.plan image.picture[href]").waitFor({ state: "attached" });
    let letGo = () => {};
    const held = new Promise((resolve) => (letGo = resolve));
    await page.route(/lidar-maps\/upper\/image\.png/, async (route) => {
      await held;
      await route.continue();
    });
    await level.selectOption("upper");
    await page.locator(".views[data-level=upper]").waitFor();
    assert.equal(await picture.getAttribute("href"), null, "the plan of the old level is shown");
    letGo();
    await page.locator(".views svg.plan image.picture[href]").waitFor({ state: "attached" });
    await page.unroute(/lidar-maps\/upper\/image\.png/);
  }

  /** The eye stands away from the room that a typed address names. */
  async function aRoomIsOpenedByItsAddress() {
    const { rooms } = await open("/v1/homes/house/map/rooms");
    const room = rooms.find(({ level }) => level === "upper");
    const other = await page.context().newPage();
    await other.goto(`${base}/homes/house?level=upper&view=3d&at=room.${room.id}`);
    await other.waitForFunction(() => /from=/.test(location.hash));
    const distance_m = await other.evaluate(() => {
      const [x, y, z, ...to] = new URLSearchParams(location.hash.split("?")[1]).get("from").split("_").map(Number);
      return Math.hypot(x - to[0], y - to[1], z - to[2]);
    });
    await other.close();
    assert.ok(distance_m > 1, `the eye is ${distance_m} m from the room`);
  }

  /** A map of a level that has one asks first; a new level is added, a replacement is taken back. */
  async function aMapIsAddedReplacedAndTakenBack() {
    await makeHome("Attic");
    const stored = (name) => page.locator(".upload > [role=status]", { hasText: `${name} is stored.` }).waitFor({ state: "attached" });
    const maps = async () => (await open("/v1/homes/attic/lidar-maps")).items.map(({ level, file_name }) => `${level} ${file_name}`);
    await dropFiles(page, [{ name: "room.csv", bytes: smallRoom() }]);
    await stored("room.csv");
    const map = await file("normal", "valetudo.json");
    const dialog = page.getByRole("dialog");
    const isAsked = () => dialog.getByRole("heading", { name: "The level “Main” has a LiDAR map already" }).waitFor();
    await dropFiles(page, [map]);
    await isAsked();
    await shot("18-second-map");
    await page.keyboard.press("Escape");
    await dialog.waitFor({ state: "detached" });
    assert.deepEqual(await maps(), ["main room.csv"]);
    // Neither a name that is taken nor none is accepted.
    await dropFiles(page, [map]);
    await isAsked();
    for (const name of ["main", "Main", ""]) {
      await dialog.getByRole("textbox").fill(name);
      await page.keyboard.press("Enter");
      assert.equal(await dialog.count(), 1, `"${name}" was taken as a level`);
    }
    await dialog.getByRole("textbox").fill("Upper");
    await dialog.getByText("It will be shown as “Upper”.").waitFor();
    await dialog.getByRole("button", { name: "Add level" }).click();
    await stored("valetudo.json");
    assert.deepEqual(await maps(), ["main room.csv", "upper valetudo.json"]);
    await page.getByLabel("Level", { exact: true }).waitFor();
    await dropFiles(page, [map]);
    await isAsked();
    await dialog.getByRole("button", { name: "Replace map" }).click();
    await page.getByText("The map of the level “Main” is replaced.").waitFor();
    assert.deepEqual(await maps(), ["main valetudo.json", "upper valetudo.json"]);
    await page.getByRole("button", { name: "Undo" }).click();
    await page.getByText("The level “Main” has its earlier map again.").waitFor();
    assert.deepEqual(await maps(), ["main room.csv", "upper valetudo.json"]);
    // The replaced map stays in the list, also when the offer is gone.
    await page.locator("summary", { hasText: "Earlier LiDAR maps" }).click();
    await page.getByRole("button", { name: /^Restore valetudo\.json of/ }).click();
    await page.getByText("valetudo.json is the LiDAR map of the level “Main” again.").waitFor();
    assert.deepEqual(await maps(), ["main valetudo.json", "upper valetudo.json"]);
    await page.getByRole("button", { name: /^Restore room\.csv of/ }).waitFor();
    await page.getByRole("button", { name: "Delete level" }).click();
    await dialog.getByRole("button", { name: "Delete level" }).click();
    await page.locator(".views[data-level=upper]").waitFor();
    assert.deepEqual(await maps(), ["upper valetudo.json"]);
    assert.ok(await page.getByRole("button", { name: "Delete level" }).isHidden(), "the last level cannot be deleted");
    // The list shows the map of the only level.
    await go("#/");
    await page.locator(".home-card[data-key=attic] img[src*='/attic/lidar-map/image.png?revision=']").evaluate((image) => image.decode());
  }

  async function aForeignClipIsExplained() {
    await makeHome("Elsewhere");
    await put("/v1/homes/elsewhere/lidar-map", smallRoom());
    await dropFiles(page, [await file("repeated", "clip_0.zip")]);
    const clip = page.locator("li.clip:is(.failed, .ambiguous)");
    await clip.waitFor();
    await clip.locator(".advice", { hasText: "Probably not this home" }).waitFor();
    await hasThumbnail(clip.locator("img"));
    await shot("16-foreign-home");
    const { items } = await open("/v1/homes/elsewhere/clips");
    await go(`#/homes/elsewhere/clips/${items[0].id}`);
    await page.locator(".verdict .advice", { hasText: "Probably not this home" }).waitFor();
    assert.ok((await page.locator(".verdict .reasons li").count()) > 0, "no reason is told");
    await hasThumbnail(page.locator(".verdict img"));
    const frames = page.getByRole("img", { name: "A few frames of the clip" });
    await frames.scrollIntoViewIfNeeded();
    const [width, height] = await frames.evaluate(async (image) => {
      await image.decode();
      return [image.naturalWidth, image.naturalHeight];
    });
    assert.ok(width > 2 * height && height >= 100, `the frames are a picture of ${width} x ${height} pixels`);
    assert.equal(await page.locator("main button.primary").count(), 0, "a doubtful place is offered as the obvious choice");
    await shot("17-foreign-clip");
  }

  return [aLevelIsChosen, aMapIsAddedReplacedAndTakenBack, aForeignClipIsExplained];
}
