// The steps of a person at the map of a home: look at objects and rooms, correct them, measure, take files away.
import assert from "node:assert/strict";
import { boxOf } from "./page.mjs";

/** The steps, in their order; they expect the page of the home `flat`, whose one clip is aligned. */
export function homeSteps({ browser, context, page, base, open, shot, serviceRests }) {
  async function mapIs(revision) {
    await page.locator(`.views[data-revision="${revision}"]`).waitFor({ state: "attached" });
  }

  const focusedKey = () => page.evaluate(() => document.activeElement.dataset.key);

  async function objectsAreFoundAndCorrected() {
    const revision = async () => (await open("/v1/homes/flat/map")).revision;
    const { objects } = await open("/v1/homes/flat/map/objects");
    assert.ok(objects.length > 0, "the map has no object");
    const [object] = objects;
    const row = (id) => page.locator(`.thing-row[data-key="object ${id}"]`);
    const details = page.locator(".details");
    await page.getByLabel("Search rooms and objects").fill(object.id);
    await row(object.id).click();
    await details.getByText("sure").waitFor();
    assert.equal(await row(object.id).getAttribute("aria-pressed"), "true");
    await shot("06-selected");
    let next = (await revision()) + 1;
    const pin = details.getByRole("button", { name: "Pin", exact: true });
    await pin.focus();
    await page.keyboard.press("Enter");
    await mapIs(next++);
    // The card is drawn again, and the focus stays.
    await details.getByRole("button", { name: "Unpin" }).waitFor();
    assert.equal(await focusedKey(), "Pin");
    await details.getByRole("button", { name: "Withdraw corrections" }).click();
    await mapIs(next++);
    await pin.waitFor();
    await details.getByRole("button", { name: "Rename" }).click();
    await page.getByRole("dialog").getByRole("textbox").fill("Grandma's");
    await page.keyboard.press("Enter");
    await mapIs(next++);
    await details.getByRole("heading", { name: "Grandma's" }).waitFor();
    await page.getByLabel("Search rooms and objects").fill("grandma");
    assert.equal(await page.locator(".thing-row").count(), 1);
    await details.getByRole("button", { name: "Change class" }).click();
    await page.getByRole("dialog").getByRole("combobox").selectOption("plant");
    await page.getByRole("button", { name: "Change", exact: true }).click();
    await mapIs(next++);
    await details.getByText("Plant, ").waitFor();
    await page.locator("label:has(#view-2d)").click();
    await page.locator(".plan .things title", { hasText: "Grandma's, set by a person" }).waitFor({ state: "attached" });
    await page.locator("label:has(#view-3d)").click();
    // The row goes before the service has another map.
    await page.route(/\/map$/, (route) => route.abort());
    await details.getByRole("button", { name: "Remove" }).click();
    await row(object.id).waitFor({ state: "detached" });
    await page.unroute(/\/map$/);
    await mapIs(next++);
    await page.getByRole("button", { name: "Undo" }).click();
    await mapIs(next++);
    await row(object.id).waitFor();
    // The offer to undo is closed, and the list of removed objects stays.
    await row(object.id).click();
    await details.getByRole("button", { name: "Remove" }).click();
    await page.locator(".toast.offer").getByRole("button", { name: "Dismiss" }).click();
    await mapIs(next++);
    await page.locator("summary", { hasText: "Removed objects" }).click();
    await page.getByRole("button", { name: "Bring back Grandma's" }).click();
    await mapIs(next++);
    await row(object.id).waitFor();
    await page.getByText("No object is removed.").waitFor();
    await page.getByLabel("Search rooms and objects").fill("");
    await page.locator("summary", { hasText: "Changes" }).click();
    await page.locator(".compare").getByText("1 object found again").waitFor();
    await shot("06-changes");
  }

  async function anObjectIsClicked() {
    const { objects } = await open("/v1/homes/flat/map/objects");
    // The smallest object at a point is selected, so the smallest of all is.
    const area = ({ size_m: [length, width] }) => length * width;
    const [object] = objects.sort((a, b) => area(a) - area(b));
    await page.locator("label:has(#view-2d)").click();
    await page.keyboard.press("Escape");
    const [x, y] = await page.locator("svg.plan").first().evaluate((plan, [x_m, y_m]) => {
      const at = new DOMPoint(100 * x_m, -100 * y_m).matrixTransform(plan.getScreenCTM());
      return [at.x, at.y];
    }, object.centre_m);
    await page.locator(".details").evaluate((card) => (card.style.visibility = "hidden"));
    await page.mouse.click(x, y);
    const ring = await page.locator("svg.plan").first().evaluate((plan) => getComputedStyle(plan).outlineStyle);
    assert.equal(ring, "none", "a click draws a ring around the plan");
    await page.locator(".details").evaluate((card) => (card.style.visibility = ""));
    await page.locator(`.thing-row[data-key="object ${object.id}"][aria-pressed=true]`).waitFor();
    await page.locator("label:has(#view-3d)").click();
  }

  /** True if all of a card is in sight while its heading is as long as a name may be. */
  function holdsALongName(card) {
    return card.evaluate((element) => {
      const heading = element.querySelector("h2");
      const name = heading.textContent;
      heading.textContent = "M".repeat(100);
      const holds = element.scrollWidth <= element.clientWidth;
      heading.textContent = name;
      return holds;
    });
  }

  async function aRoomIsRenamedAndDivided() {
    const { rooms } = await open("/v1/homes/flat/map/rooms");
    const [room] = rooms.sort((a, b) => b.area_m2 - a.area_m2);
    const total_m2 = rooms.reduce((sum, { area_m2 }) => sum + area_m2, 0);
    assert.equal(await page.locator(".things .group").first().textContent(), `Rooms · ${total_m2.toFixed(1)} m²`);
    const details = page.locator(".details");
    let next = (await open("/v1/homes/flat/map")).revision + 1;
    await page.locator(`.thing-row[data-key="room ${room.id}"]`).click();
    await details.getByRole("button", { name: "Rename" }).click();
    await page.getByRole("dialog").getByRole("textbox").fill("Atelier");
    await page.keyboard.press("Enter");
    await mapIs(next++);
    await details.getByRole("heading", { name: "Atelier" }).waitFor();
    assert.ok(await holdsALongName(details), "a name of one long word pushes the buttons out of the card");
    await page.locator("label:has(#view-2d)").click();
    const split = details.getByRole("button", { name: "Split" });
    await split.click();
    await details.waitFor({ state: "hidden" });
    await page.getByRole("button", { name: "Cancel" }).click();
    await details.waitFor();
    assert.equal(await focusedKey(), "Split");
    // The line is for the room that it was asked for, and for no other.
    await split.click();
    await page.locator('.thing-row[data-key^="object "]').first().click();
    assert.ok(await page.locator(".measure").isHidden(), "another selection does not end the split");
    await page.locator(`.thing-row[data-key="room ${room.id}"]`).click();
    await split.click();
    // Across the middle of the room, which lies in the middle of the plan now.
    const shape = await boxOf(page.locator("path.room.selected"));
    const x = shape.x + shape.width / 2;
    await page.mouse.click(x, shape.y + 4);
    await page.mouse.click(x, shape.y + shape.height - 4);
    await mapIs(next++);
    await page.locator(`.thing-row[data-key="room ${room.id}-b"]`).waitFor();
    await shot("06-divided");
    await details.getByRole("button", { name: "Withdraw corrections" }).click();
    await mapIs(next++);
    await page.locator(`.thing-row[data-key="room ${room.id}-b"]`).waitFor({ state: "detached" });
  }

  /** The view moves under the crosshair, and Enter takes the point there. */
  async function aLineIsMeasuredByKeys() {
    const told = (text) => page.locator(".measure [role=status]", { hasText: text });
    const length = async () => Number.parseFloat(await page.locator(".measure [role=status]").textContent());
    for (const view of ["2d", "3d"]) {
      await page.locator(`label:has(#view-${view})`).click();
      await page.getByRole("button", { name: "Measure" }).focus();
      await page.keyboard.press("Enter");
      await page.locator(".crosshair").waitFor();
      await told("Enter takes x").waitFor();
      await page.keyboard.press("Enter");
      await told("0.0 cm to x").waitFor();
      await page.keyboard.press(view === "2d" ? "ArrowUp" : "w");
      await told("0.0 cm to x").waitFor({ state: "detached" });
      const aimed = await length();
      await shot(`06-crosshair-${view}`);
      await page.keyboard.press("Enter");
      await told("to x").waitFor({ state: "detached" });
      assert.equal(await length(), aimed);
      await page.keyboard.press("Backspace");
      await told("Backspace drops").waitFor();
      await page.keyboard.press("Escape");
      assert.ok(await page.locator(".measure").isHidden());
    }
  }

  async function linesAreMeasured() {
    const closed = page.locator(".details");
    const selected = await page.locator(".thing-row[aria-pressed=true]").getAttribute("data-key");
    for (const [button, key] of [["Rename", "Escape"], ["Close", "Enter"]]) {
      await closed.getByRole("button", { name: button }).focus();
      await page.keyboard.press(key);
      await closed.waitFor({ state: "hidden" });
      assert.equal(await focusedKey(), selected);
      if (key !== "Escape") continue;
      await page.keyboard.press("Enter");
      assert.ok(await closed.evaluate((card) => card === document.activeElement), "a selection by keys does not lead to the card");
    }
    const box = await boxOf(page.locator("svg.plan").first());
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await page.getByRole("button", { name: "Measure" }).click();
    await page.mouse.click(x, y);
    await page.mouse.click(x + 100, y);
    await page.locator(".measure").getByRole("button", { name: "Done" }).waitFor();
    const flat = Number.parseFloat(await page.locator(".measure").textContent());
    const { info } = await open("/v1/homes/flat/lidar-map");
    assert.ok(flat > 0 && flat < info.max_m[0] - info.min_m[0] + 1, `100 pixels are ${flat} m`);
    await page.keyboard.press("Escape");
    await page.locator("label:has(#view-3d)").click();
    await page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
  }

  async function everythingIsDownloaded() {
    await page.locator("summary", { hasText: "Downloads" }).click();
    const links = page.locator(".downloads a");
    const formats = await page.locator(".downloads .hint").allTextContents();
    for (const format of ["SVG", "PNG", "PDF", "DXF", "GeoJSON", "JSON", "GLB", "USDZ", "OBJ", "PLY", "ZIP"]) {
      assert.ok(formats.includes(format), `no ${format} among ${formats}`);
    }
    for (const link of await links.all()) {
      const answer = await page.request.get(base + (await link.getAttribute("href")));
      assert.ok(answer.ok(), `${await link.textContent()}: ${answer.status()}`);
      assert.ok((await answer.body()).length > 100, `${await link.textContent()} is empty`);
    }
  }

  async function aViewIsShared() {
    await page.locator(".thing-row").first().click();
    const name = await page.locator(".details h2").textContent();
    await page.locator("label:has(#colouring-class)").click();
    await page.locator(".stage-3d canvas").focus();
    for (const key of ["ArrowLeft", "+", "w"]) await page.keyboard.press(key);
    await page.getByRole("button", { name: "Share" }).click();
    await page.getByText("The link to this view is copied.").waitFor();
    const address = await page.evaluate(() => navigator.clipboard.readText());
    const other = await context.newPage();
    await other.goto(address);
    await other.locator(".details h2", { hasText: name }).waitFor();
    await other.locator(".views[data-colouring=class]").waitFor();
    // The camera stands where it stood, also after another reading of the page.
    for (const again of [false, true]) {
      if (again) await other.reload();
      await other.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
      await other.getByRole("button", { name: "Share" }).click();
      await other.getByText("The link to this view is copied.").waitFor();
      assert.deepEqual(from(await other.evaluate(() => location.href)), from(address));
    }
    await other.close();
  }

  /** A person who asks for the whole home gets it, also while the view still moves to an object. */
  async function aFlightGivesWay() {
    const share = page.getByRole("button", { name: "Share" });
    const camera = () => page.evaluate(() => new URLSearchParams(location.hash.split("?")[1]).get("from"));
    await page.getByRole("button", { name: "Fit" }).click();
    await share.click();
    const whole = await camera();
    await page.locator(".stage-3d canvas").focus();
    await page.keyboard.press("+");
    await share.click();
    assert.notEqual(await camera(), whole);
    await page.evaluate(() => {
      document.querySelector(".thing-row").click();
      [...document.querySelectorAll(".toolbar button")].find(({ textContent }) => textContent === "Fit").click();
    });
    await page.waitForFunction((whole) => new URLSearchParams(location.hash.split("?")[1]).get("from") === whole, whole);
  }

  /** The numbers of the camera in an address: its eye and its target. */
  function from(address) {
    const numbers = new URLSearchParams(address.split("?")[1]).get("from").split("_").map(Number);
    assert.ok(numbers.length === 6 && numbers.every(Number.isFinite), address);
    return numbers;
  }

  /** The browser's button leads back to the view that a person left for a clip. */
  async function aViewIsFoundAgain() {
    const plan = page.locator("svg.plan").first();
    const part = async () => (await plan.getAttribute("viewBox")).split(" ").map(Number);
    await page.locator("label:has(#view-2d)").click();
    await plan.focus();
    await page.keyboard.press("+");
    const before = await part();
    await page.locator("label:has(#colouring-clip)").click();
    const side = page.locator(".side");
    await side.evaluate((side) => (side.scrollTop = 60));
    await page.waitForFunction(() => /colour=clip.*part=/.test(location.hash) && history.state?.side_px === 60);
    const [hash, entries] = await page.evaluate(() => [location.hash, history.length]);
    await page.locator("li.clip .title").first().click();
    await page.locator("[data-alternative]").first().waitFor();
    assert.equal(await page.evaluate(() => history.length), entries + 1);
    await page.goBack();
    await page.locator(".views[data-colouring=clip][data-view='2d']").waitFor();
    assert.equal(await page.evaluate(() => location.hash), hash);
    assert.equal(await side.evaluate((side) => side.scrollTop), 60);
    // An address has centimetres.
    const after = await part();
    assert.ok(after.every((value, i) => Math.abs(value - before[i]) < 2), `the plan shows ${after} instead of ${before}`);
    await plan.focus();
    await page.keyboard.press("0");
    await page.locator("label:has(#colouring-class)").click();
    await page.locator("label:has(#view-3d)").click();
  }

  /** The page's clock goes on by five seconds, then by ten minutes: no timer may ask for anything. */
  async function aQuietHomeIsNotAskedAbout() {
    await serviceRests();
    // A clock belongs to all pages of its context.
    const apart = await browser.newContext();
    const quiet = await apart.newPage();
    await quiet.clock.install();
    await quiet.goto(`${base}/#/homes/flat?view=3d&as=surface`);
    await quiet.locator(".thing-row").first().waitFor();
    await quiet.waitForFunction(() => Number(document.querySelector(".views")?.dataset.points ?? 0) > 0);
    await quiet.waitForFunction(() => Number(document.querySelector(".views")?.dataset.surface ?? 0) > 0);
    await quiet.locator("li.clip img").first().evaluate((image) => image.decode());
    const asked = [];
    quiet.on("request", (request) => asked.push(request.url()));
    const isQuiet = async () => {
      asked.length = 0;
      await quiet.clock.fastForward("00:05");
      await quiet.clock.fastForward("10:00");
      assert.deepEqual(asked.filter((address) => !address.startsWith("blob:")), []);
    };
    await isQuiet();
    await quiet.goto(`${base}/#/`);
    await quiet.locator(".home-card img").first().evaluate((image) => image.decode());
    await isQuiet();
    await apart.close();
  }

  async function aHomeIsRenamed() {
    for (const name of ["Flat 3", "Flat"]) {
      await page.getByRole("button", { name: "Rename home" }).click();
      await page.getByRole("dialog").getByRole("textbox").fill(name);
      await page.keyboard.press("Enter");
      await page.getByRole("heading", { level: 1, name, exact: true }).waitFor();
      await page.locator(".crumbs [aria-current]", { hasText: name }).waitFor();
    }
  }

  return [
    objectsAreFoundAndCorrected, anObjectIsClicked, aRoomIsRenamedAndDivided, linesAreMeasured, aLineIsMeasuredByKeys, everythingIsDownloaded,
    aViewIsShared, aFlightGivesWay, aViewIsFoundAgain, aHomeIsRenamed, aQuietHomeIsNotAskedAbout,
  ];
}
