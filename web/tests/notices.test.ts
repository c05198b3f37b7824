import { body, fake, until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, mock, test } from "node:test";
import { home, Refusal } from "../src/api.ts";
import { fileLink } from "../src/parts/download.ts";
import { attempt, clearNotices, noticeBoard } from "../src/parts/notices.ts";
import { onSessionEnd } from "../src/session.ts";

const real = { fetch: globalThis.fetch };
const board = fake(noticeBoard());
body.replaceChildren(board);
afterEach(() => {
  Object.assign(globalThis, real);
  mock.timers.reset();
  clearNotices();
});

const alarms = () => board.all("span").map(({ textContent }) => textContent);
const fail = (status: number, text: string) => attempt(null, async () => {
  throw new Refusal(status, text);
});

test("an alarm of a lost service goes when the service answers, and not before it can be read", async () => {
  mock.timers.enable({ apis: ["setTimeout"] });
  const answered = () => home("h", new AbortController().signal);
  globalThis.fetch = async () => new Response("{}");
  await fail(0, "lost");
  await fail(409, "taken");
  await answered();
  assert.deepEqual(alarms(), ["lost", "taken"]);
  mock.timers.tick(6000);
  assert.deepEqual(alarms(), ["taken"]);
  // A loss that comes again stays until the next answer.
  await fail(0, "lost");
  await answered();
  await fail(0, "lost");
  mock.timers.tick(6000);
  assert.deepEqual(alarms(), ["taken", "lost"]);
});

test("an action that succeeds takes the alarms of failed ones away", async () => {
  await fail(0, "lost");
  await fail(409, "taken");
  assert.deepEqual(alarms(), ["lost", "taken"]);
  await attempt(null, async () => {});
  assert.deepEqual(alarms(), []);
});

test("a download that cannot succeed is told by the page, for the browser does not", async () => {
  let ended = "";
  onSessionEnd((message) => (ended = message));
  let status = 404;
  const asked: string[] = [];
  globalThis.fetch = async (path) => {
    asked.push(String(path));
    return new Response(JSON.stringify({ detail: `refused with ${status}` }), { status });
  };
  const link = fileLink("flat 3", "/v1/homes/flat%203/map/plan?format=pdf", "plan.pdf", "Floor plan");
  const click = () => link.dispatchEvent(new Event("click"));
  click();
  await until(() => alarms().length > 0);
  assert.deepEqual([alarms(), asked], [["refused with 404"], ["/v1/homes/flat%203"]]);
  status = 401;
  click();
  await until(() => ended !== "");
  assert.equal(ended, "refused with 401");
});
