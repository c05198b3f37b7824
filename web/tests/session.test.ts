import "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, beforeEach, test } from "node:test";
import { Refusal } from "../src/api.ts";
import { SessionFollower } from "../src/pages/follow.ts";
import { attempt } from "../src/parts/notices.ts";
import type { Session } from "../src/types.ts";
import { until } from "./dom.ts";

/** Node.js keeps running while a channel is open, and a browser does not. */
globalThis.BroadcastChannel = class extends BroadcastChannel {
  constructor(name: string) {
    super(name);
    (this as unknown as { unref: () => void }).unref();
  }
};

/** Another tab of the browser. */
let otherTab: BroadcastChannel;
let told = 0;
const real = { fetch: globalThis.fetch };
const admin = { tenant: "acme", role: "admin", with_key: true } as const;

/** The session that the service has; null if nobody is signed in. */
let now: Session | null = admin;
let asked = 0;
let shown = 0;
const follower = new SessionFollower(() => shown++);

beforeEach(() => {
  [now, asked, shown, told] = [admin, 0, 0, 0];
  globalThis.fetch = async () => {
    asked++;
    return now ? new Response(JSON.stringify(now)) : new Response("{}", { status: 401 });
  };
  otherTab = new BroadcastChannel("viola.session");
  otherTab.onmessage = () => told++;
  follower.began(admin);
});
afterEach(() => {
  otherTab.close();
  Object.assign(globalThis, real);
});

const refused = () => attempt(null, () => Promise.reject(new Refusal(401, "the session has ended")));

test("a refused action leads to the form to sign in when the session has ended", async () => {
  now = null;
  await refused();
  await until(() => shown === 1);
  // The page shows the form then, and the other tabs hear of it.
  assert.ok(follower.ended());
  await until(() => told === 1);
  assert.equal(follower.ended(), false, "the end is told once");
  await refused();
  await until(() => asked === 2);
  assert.equal(shown, 1, "the form is shown again, and what was typed is lost");
});

test("a refusal in a session that lasts is told, and does not show the page again", async () => {
  await refused();
  await until(() => asked === 1);
  assert.equal(shown, 0);
});

test("another tab signs in, signs in with another key, and signs out", async () => {
  const changed = async (session: Session | null, expected: number) => {
    const before = asked;
    now = session;
    otherTab.postMessage("changed");
    await until(() => asked > before);
    await until(() => shown === expected);
    if (session) follower.began(session);
    else follower.ended();
  };
  await changed(admin, 0);
  await changed({ ...admin, role: "reader" }, 1);
  await changed({ ...admin, tenant: "other", role: "reader" }, 2);
  await changed(null, 3);
  await changed(null, 3);
  await changed(admin, 4);
});
