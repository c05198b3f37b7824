// Signs in with a key and out again, in Chromium. `tests/browser` starts it with the server's address and the key.
import assert from "node:assert/strict";
import { chromium } from "playwright-core";

const { VIOLA_BASE: base, VIOLA_KEY: key } = process.env;
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
await browser.close();
