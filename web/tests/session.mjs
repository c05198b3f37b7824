// Signs in with a key and out again, in Chromium. `tests/browser` starts it with the server's address and the key.
import assert from "node:assert/strict";
import { chromium } from "playwright-core";

const { VIOLA_BASE: base, VIOLA_KEY: key, VIOLA_READER: reader, VIOLA_OF_HOME: ofHome, VIOLA_UPLOADER: uploader } = process.env;
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const context = await browser.newContext();
const page = await context.newPage();
const leave = page.getByRole("button", { name: "Sign out" });
const form = page.getByRole("heading", { name: "This service asks for a key" });
const status = async () => (await page.request.get(`${base}/v1/homes`)).status();

await page.goto(base);
await form.waitFor();
assert.equal(await leave.count(), 0, "nobody is signed in");

await page.getByLabel("Key").fill(`${key.slice(0, -1)}${key.endsWith("0") ? "1" : "0"}`);
await page.getByRole("button", { name: "Sign in" }).click();
await page.getByText("The key is not one of this service's").waitFor({ state: "attached" });
assert.equal(await status(), 401);

await page.getByLabel("Key").fill(key);
await page.getByRole("button", { name: "Sign in" }).click();
await page.getByRole("heading", { level: 1, name: "Homes" }).waitFor();
await leave.waitFor();
assert.equal(await status(), 200);
const [cookie] = await context.cookies();
assert.ok(cookie.httpOnly && !cookie.value.includes(key.slice(6)), "the page has a session, and not the key");

// The cookie that was copied before ends with the session.
await leave.click();
await form.waitFor();
await leave.waitFor({ state: "hidden" });
assert.deepEqual(await context.cookies(), []);
const copied = await page.request.get(`${base}/v1/homes`, { headers: { cookie: `${cookie.name}=${cookie.value}` } });
assert.equal(copied.status(), 401);
assert.equal((await copied.json()).type, "urn:viola:problem:session-ended");

async function signIn(key) {
  await page.getByLabel("Key").fill(key);
  await page.getByRole("button", { name: "Sign in" }).click();
}

async function signOut() {
  await leave.click();
  await form.waitFor();
}

// Two tabs: both ask for the key when one of them signs out, and both show the homes when one of them signs in.
const second = await context.newPage();
const secondForm = second.getByRole("heading", { name: "This service asks for a key" });
const homes = (tab) => tab.getByRole("heading", { level: 1, name: "Homes" });
await second.goto(base);
await secondForm.waitFor();
await signIn(key);
await homes(page).waitFor();
await homes(second).waitFor();
await signOut();
await secondForm.waitFor();
await second.getByText("You are signed out").waitFor();
assert.equal(await page.getByText("You are signed out").count(), 0, "the tab that signs out is told that it was signed out");

// A tab that did not hear of it asks for the key after the first refused action.
await signIn(key);
await homes(second).waitFor();
await context.clearCookies();
await second.getByLabel("Name of the new home").fill("Never");
await second.keyboard.press("Enter");
await secondForm.waitFor();
await form.waitFor();
await second.close();

// As without TLS: the browser drops the cookie.
await page.route("**/v1/session", (route) => (route.request().method() === "PUT" ? route.fulfill({ status: 204 }) : route.continue()));
await signIn(key);
await page.getByText("the browser kept no session cookie").waitFor();
await page.unroute("**/v1/session");

// An admin makes the home; a reader sees it and is offered nothing that changes it.
await signIn(key);
await page.getByLabel("Name of the new home").fill("Flat");
await page.keyboard.press("Enter");
await page.locator("label[for=choose-clip]").waitFor();
await page.getByRole("button", { name: "Delete home" }).waitFor();
await signOut();
await signIn(reader);
await page.getByRole("heading", { level: 1, name: "Flat" }).waitFor();
assert.equal(await page.locator("label[for=choose-clip]").count(), 0);
assert.equal(await page.getByRole("button", { name: "Delete home" }).count(), 0);
await page.goto(`${base}/#/`);
await page.getByRole("link", { name: "Flat" }).waitFor();
assert.equal(await page.getByRole("button", { name: "New home" }).count(), 0);
await signOut();

// A key of one home cannot list them; its page asks for the home.
await signIn(ofHome);
await page.getByRole("heading", { name: "This key is for one home" }).waitFor();
await page.getByLabel("Id of the home").fill("flat");
await page.keyboard.press("Enter");
await page.getByRole("heading", { level: 1, name: "Flat" }).waitFor();
await signOut();
await signIn(uploader);
await page.getByRole("heading", { name: "This key only uploads" }).waitFor();
await signOut();
await browser.close();
