// The steps of a person who looks at the surface of a home, and at what is to be filmed.
import assert from "node:assert/strict";
import { join } from "node:path";
import { isResponsive } from "./page.mjs";

/** Input waits at most so long for the mesh of a home that is drawn by software, beside what it waits without one. */
const RESPONSIVE_MS = 100;

/** The steps expect the page of the home `flat` in three dimensions. */
export function surfaceSteps({ page, open, say, pictures, touchEverything, serviceRests }) {
  const stage = (name) => page.locator(".stage").screenshot({ path: join(pictures, `${name}.png`) });
  const surfaceShown = () => page.waitForFunction(() => Number(document.querySelector(".views")?.dataset.surface) > 1000);
  const isDrawn = () => page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });

  async function theSurfaceIsShownAndFollowsTheMap() {
    const meshes = [];
    const note = (request) => request.url().includes("/map/mesh") && meshes.push(request.url());
    page.on("request", note);
    assert.deepEqual(meshes, []);
    await page.locator("label:has(#body-surface)").click();
    await surfaceShown();
    assert.equal(meshes.length, 1);
    await isDrawn();
    await stage("18-surface-colour");
    // A surface has no clips and no probabilities.
    assert.ok(await page.locator("#colouring-clip").isDisabled());
    assert.ok(await page.locator("li.clip.aligned input").first().isDisabled(), "the surface cannot leave out a clip");
    await page.locator("label:has(#colouring-class)").click();
    await page.locator(".legend", { hasText: "Wall" }).waitFor();
    await isDrawn();
    await stage("18-surface-class");
    // Back to the points and to the surface again: it is still there.
    await page.locator("label:has(#body-points)").click();
    await page.locator(".views[data-surface='']").waitFor({ state: "attached" });
    assert.ok(await page.locator("li.clip.aligned input").first().isEnabled());
    await page.locator("label:has(#body-surface)").click();
    await surfaceShown();
    assert.equal(meshes.length, 1, "an unchanged surface was asked for again");
    // The revision with another name has the same surface.
    const { rooms } = await open("/v1/homes/flat/map/rooms");
    const { revision } = await open("/v1/homes/flat/map");
    const next = page.waitForResponse((answer) => answer.url().includes("/map/mesh"));
    await page.locator(`.thing-row[data-key="room ${rooms[0].id}"]`).click();
    await page.locator(".details").getByRole("button", { name: "Rename" }).click();
    await page.getByRole("dialog").getByRole("textbox").fill("Studio");
    await page.keyboard.press("Enter");
    await page.locator(`.views[data-revision="${revision + 1}"]`).waitFor({ state: "attached" });
    assert.equal((await next).status(), 304);
    await surfaceShown();
    await page.locator(".details").getByRole("button", { name: "Close" }).click();
    page.off("request", note);
  }

  async function aSurfaceStaysResponsive() {
    await serviceRests();
    await surfaceShown();
    await page.locator("label:has(#colouring-colour)").click();
    await isDrawn();
    const isShown = async () => {
      await surfaceShown();
      await isDrawn();
    };
    say(`${await page.locator(".views").getAttribute("data-surface")} triangles`);
    await isResponsive(page, { act: () => touchEverything(["class", "colour"]), isShown, limit_ms: RESPONSIVE_MS, say });
    await page.locator("label:has(#body-points)").click();
    await isDrawn();
  }

  async function roomsToFilmAreMarked() {
    const { by_room } = await open("/v1/homes/flat/map/coverage");
    const wanted = by_room.filter(({ seen }) => seen < 0.5);
    await page.locator("input[data-name=coverage]").check();
    for (const view of ["3d", "2d"]) {
      await page.locator(`label:has(#view-${view})`).click();
      if (wanted.length > 0) await page.locator(".legend", { hasText: "Film here next" }).waitFor();
      if (view === "3d") await isDrawn();
      await stage(`19-coverage-${view}`);
    }
    const next = Math.min(1, wanted.length);
    assert.equal(await page.locator("path.room.filmed").count(), by_room.length - next);
    assert.equal(await page.locator("path.room.wanted").count(), wanted.length);
    assert.equal(await page.locator("path.room.next").count(), next);
    await page.locator("summary", { hasText: "Coverage" }).click();
    const rows = page.locator(".coverage-row");
    assert.equal(await rows.count(), by_room.length);
    assert.equal(await rows.filter({ hasText: "film here next" }).count(), next);
    if (next > 0) {
      const [advice, word] = await page.locator(".coverage-row .next").evaluate((advice) => {
        const word = advice.parentElement;
        word.querySelector("bdi").textContent = "The room behind the long corridor ".repeat(4);
        return [advice, word].map((element) => element.getBoundingClientRect().right);
      });
      assert.ok(advice <= word + 1, `a long name cuts off the advice: it ends at ${advice} px of ${word} px`);
    }
    await page.locator("input[data-name=coverage]").uncheck();
    await page.locator("label:has(#view-3d)").click();
  }

  /** The names that are shown do not lie on each other. */
  async function namesDoNotCollide() {
    for (const view of ["3d", "2d"]) {
      await page.locator(`label:has(#view-${view})`).click();
      if (view === "3d") {
        // A step before may have left the view at one room.
        await page.getByRole("button", { name: "Fit" }).click();
        await isDrawn();
      }
      const boxes = await page.evaluate((selector) => [...document.querySelectorAll(selector)]
        .map((name) => ({ text: name.textContent, box: name.getBoundingClientRect().toJSON() }))
        .filter(({ box }) => box.width > 0), view === "3d" ? ".stage-3d .name" : "svg.plan text");
      assert.ok(boxes.length > 2, `${boxes.length} names in ${view}`);
      boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => {
        const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
        const along = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
        // Lines of text may touch.
        assert.ok(across < 1 || along < 4, `in ${view}, ${a.text} lies on ${b.text} by ${across} x ${along} pixels`);
      }));
    }
    await page.locator("label:has(#view-3d)").click();
  }

  return [theSurfaceIsShownAndFollowsTheMap, aSurfaceStaysResponsive, roomsToFilmAreMarked, namesDoNotCollide];
}
