import { body, fake } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { Refusal } from "../src/api.ts";
import { h } from "../src/dom.ts";
import { FailurePage } from "../src/pages/failure.ts";
import { Backoff } from "../src/parts/backoff.ts";

const lost = new Refusal(0, "The service does not answer. Check the network of this device.");
const document = globalThis.document as unknown as EventTarget & { hidden: boolean };

beforeEach(() => mock.timers.enable({ apis: ["setTimeout"] }));
afterEach(() => {
  mock.timers.reset();
  document.hidden = false;
});

/** The page of a failure, and an attempt that fails until a test says that the service is back. */
function failing(error: unknown = lost) {
  const main = h("main");
  body.replaceChildren(fake(main));
  const service = { isBack: false, attempts: 0, pages: [] as AbortController[] };
  const attempt = () => {
    service.pages.at(-1)?.abort();
    const page = new AbortController();
    service.pages.push(page);
    service.attempts++;
    if (service.isBack) main.textContent = "Homes";
    else failure.show({ main, crumbs: h("nav"), signal: page.signal, again: () => {} }, error);
  };
  const failure = new FailurePage(attempt);
  attempt();
  return { main, failure, service, text: () => main.textContent ?? "" };
}

test("a page that cannot be shown comes by itself when the service is back", () => {
  const { main, service, text } = failing();
  const [button] = fake(main).all("button");
  assert.match(text(), /The service does not answer\. Check the network.*tell the person who runs the service\.This page tries again by itself\./);
  // Each pause is twice the one before, up to half a minute.
  const waits_s = [1, 2, 4, 8, 16, 30, 30, 30];
  waits_s.forEach((wait_s, i) => {
    mock.timers.tick(1000 * wait_s - 1);
    assert.equal(service.attempts, i + 1, `it tries after less than ${wait_s} s`);
    mock.timers.tick(1);
    assert.equal(service.attempts, i + 2, `it does not try after ${wait_s} s`);
  });
  assert.equal(fake(main).all("button")[0], button, "the same failure is drawn again, and its button loses the focus");
  service.isBack = true;
  mock.timers.tick(30_000);
  assert.equal(text(), "Homes");
  mock.timers.tick(600_000);
  assert.equal(service.attempts, waits_s.length + 2, "a shown page is asked for again");
});

test("a hidden page does not try, and tries at once when it is looked at or online again", () => {
  const { service } = failing();
  document.hidden = true;
  mock.timers.tick(600_000);
  globalThis.dispatchEvent(new Event("online"));
  assert.equal(service.attempts, 1);
  document.hidden = false;
  document.dispatchEvent(new Event("visibilitychange"));
  assert.equal(service.attempts, 2);
  globalThis.dispatchEvent(new Event("online"));
  assert.equal(service.attempts, 3);
  service.pages.at(-1)?.abort();
  mock.timers.tick(600_000);
  document.dispatchEvent(new Event("visibilitychange"));
  assert.equal(service.attempts, 3, "a page that was left tries again");
});

test("a failure that stays is not asked about again", () => {
  for (const error of [new Refusal(404, "There is no home at this address."), new Refusal(403, "No."), new Error("There is nothing at this address.")]) {
    const { service, text } = failing(error);
    mock.timers.tick(600_000);
    assert.equal(service.attempts, 1, text());
    assert.ok(!text().includes("by itself"), text());
  }
});

test("a page that a person asks for forgets the failures before", () => {
  const { failure, service } = failing();
  for (const wait_s of [1, 2, 4]) mock.timers.tick(1000 * wait_s);
  assert.equal(service.attempts, 4);
  failure.reset();
  document.dispatchEvent(new Event("visibilitychange"));
  mock.timers.tick(1000);
  assert.equal(service.attempts, 6);
});

test("a shown page is read again later after each failure, and as late as the service asks", () => {
  const backoff = new Backoff();
  const waits = [lost, lost, new Refusal(503, "Busy.", 20), new Error("It cannot be drawn.")].map((error) => backoff.nextReading_ms(error));
  assert.deepEqual(waits, [1000, 2000, 20_000, 30_000]);
  backoff.reset();
  assert.equal(backoff.nextReading_ms(lost), 1000);
});
