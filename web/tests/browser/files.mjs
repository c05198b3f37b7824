// The steps of a person who adds files that are something else than what they should be.
import assert from "node:assert/strict";
import { dropFiles } from "./page.mjs";

/** The steps expect the page of the home `flat`. */
export function fileSteps({ page, open, file, say, shot }) {
  /** The map's file is chosen where clips are added: the page offers it as the map. */
  async function aMapAmongClipsIsOfferedAsTheMap() {
    const { name, bytes } = await file("normal", "valetudo.json");
    const revision = (await open("/v1/homes/flat")).lidar_map_revision;
    await page.locator("#choose-clip").setInputFiles({ name, mimeType: "application/json", buffer: bytes });
    await page.getByRole("dialog").getByText("looks like a LiDAR map").waitFor();
    await page.getByRole("button", { name: "Cancel", exact: true }).click();
    assert.equal(await page.locator(".uploads li").count(), 0);
    assert.equal((await open("/v1/homes/flat")).lidar_map_revision, revision);
  }

  async function badFilesAreExplained() {
    await dropFiles(page, [{ name: "notes.zip", bytes: Buffer.from("these are not frames") }]);
    await page.getByRole("dialog").getByRole("button", { name: "A clip" }).click();
    const row = page.locator(".uploads li.failed");
    await row.waitFor();
    const reason = await row.locator(".reason").textContent();
    assert.ok(reason.length > 20, `the reason is "${reason}"`);
    say(`a bad file: ${reason}`);
    await shot("06-bad-file");
    await row.getByRole("button", { name: "Cancel notes.zip" }).click();
    assert.equal(await row.count(), 0);
    // A script cannot drop a folder, so the browser's answer about a file is replaced.
    const entryOf = await page.evaluateHandle(() => DataTransferItem.prototype.webkitGetAsEntry);
    await page.evaluate(() => (DataTransferItem.prototype.webkitGetAsEntry = () => ({ isDirectory: true })));
    await dropFiles(page, [{ name: "recording", bytes: Buffer.alloc(0) }]);
    const alarm = page.locator(".toast.bad", { hasText: "recording is a folder; drop its zip archive." });
    await alarm.getByRole("button", { name: "Dismiss" }).press("Enter");
    await alarm.waitFor({ state: "detached" });
    assert.equal(await page.evaluate(() => document.activeElement.tagName), "MAIN", "the focus is lost with the message");
    await page.evaluate((entryOf) => (DataTransferItem.prototype.webkitGetAsEntry = entryOf), entryOf);
    assert.equal(await row.count(), 0);
  }

  /** A film of a phone is known before it is sent, and the person is told how to make a clip. */
  async function aPlainVideoIsRefusedWithHelp() {
    const film = Buffer.concat([Buffer.from([0, 0, 0, 20]), Buffer.from("ftypqt  "), Buffer.alloc(500)]);
    const photo = Buffer.concat([Buffer.from([0, 0, 0, 20]), Buffer.from("ftypheic"), Buffer.alloc(500)]);
    const sent = [];
    const note = (request) => request.method() !== "GET" && sent.push(request.url());
    page.on("request", note);
    await dropFiles(page, [{ name: "IMG_0042.MOV", bytes: film }, { name: "IMG_0043.HEIC", bytes: photo }]);
    const dialog = page.getByRole("dialog");
    await dialog.getByRole("heading", { name: "2 files cannot be used" }).waitFor();
    await dialog.getByText("Film with an app that keeps the depth").waitFor();
    await dialog.getByText("How to get the vacuum's map").click();
    await dialog.getByText("Let the vacuum map the whole home first.").waitFor();
    await shot("06-refused");
    await page.keyboard.press("Escape");
    await dialog.waitFor({ state: "detached" });
    assert.deepEqual(sent, [], "a film was sent");
    page.off("request", note);
  }

  return [aMapAmongClipsIsOfferedAsTheMap, badFilesAreExplained, aPlainVideoIsRefusedWithHelp];
}
