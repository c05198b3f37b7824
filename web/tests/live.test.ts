import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { Followed, onHomeChange, Repeated } from "../src/parts/live.ts";
import type { Job } from "../src/types.ts";

let streams: FakeStream[] = [];
class FakeStream extends EventTarget {
  static readonly CLOSED = 2;
  readyState = 0;
  constructor(readonly path: string) {
    super();
    streams.push(this);
  }
  close(): void {
    this.readyState = FakeStream.CLOSED;
  }
}

/** The locks of a browser, as far as streams need them. */
class FakeLocks {
  private readonly held = new Set<string>();
  async request(name: string, _: object, hold: (lock: object | null) => Promise<void>): Promise<void> {
    if (this.held.has(name)) return hold(null);
    this.held.add(name);
    await hold({});
    this.held.delete(name);
  }
}

beforeEach(() => {
  streams = [];
  const [document, events] = [Object.assign(new EventTarget(), { hidden: false }), new EventTarget()];
  const [addEventListener, dispatchEvent] = [events.addEventListener.bind(events), events.dispatchEvent.bind(events)];
  Object.assign(globalThis, { EventSource: FakeStream, document, window: globalThis, addEventListener, dispatchEvent });
  Object.defineProperty(globalThis, "navigator", { value: { locks: new FakeLocks() }, configurable: true });
  mock.timers.enable({ apis: ["setTimeout"] });
});
afterEach(() => mock.timers.reset());

/** Lets everything happen that waits for no time. */
const settled = () => new Promise((resolve) => setImmediate(resolve));
const after = async (wait_ms: number) => {
  await settled();
  mock.timers.tick(wait_ms);
  await settled();
};
const openStreams = () => streams.filter(({ readyState }) => readyState !== FakeStream.CLOSED).map(({ path }) => path);

test("a stream that is lost and does not come back counts as a change", async () => {
  const page = new AbortController();
  let changes = 0;
  onHomeChange("h", () => changes++, page.signal);
  await settled();
  const happens = (name: string) => streams.at(-1)?.dispatchEvent(new Event(name));
  // The browser tries again every few seconds, with an error each time.
  const lost = () => {
    happens("error");
    mock.timers.tick(3000);
  };
  happens("open");
  assert.equal(changes, 1);
  lost();
  happens("open");
  mock.timers.tick(60_000);
  assert.equal(changes, 2, "a stream that came back was told as lost");
  lost();
  lost();
  assert.deepEqual([changes, streams.length], [3, 1]);
  happens("open");
  assert.equal(changes, 4);
  lost();
  page.abort();
  mock.timers.tick(60_000);
  assert.equal(changes, 4);
});

test("a stream that is refused again and again is opened ever later", async () => {
  const page = new AbortController();
  let changes = 0;
  onHomeChange("h", () => changes++, page.signal);
  await settled();
  const refuse = () => {
    streams.at(-1)?.close();
    streams.at(-1)?.dispatchEvent(new Event("error"));
  };
  const waits_s = [3, 6, 12, 24, 48, 48];
  for (const [i, wait_s] of waits_s.entries()) {
    refuse();
    await after(1000 * wait_s - 1);
    assert.equal(streams.length, i + 1, `it is opened after less than ${wait_s} s`);
    await after(1);
    assert.deepEqual([streams.length, changes], [i + 2, i + 1], `it is not opened after ${wait_s} s`);
  }
  streams.at(-1)?.dispatchEvent(new Event("open"));
  refuse();
  await after(3000);
  assert.equal(streams.length, waits_s.length + 2);
  page.abort();
});

test("the windows of a browser leave connections for requests", async () => {
  const windows = ["a", "b", "c", "d"].map((home) => ({ home, page: new AbortController(), changes: 0 }));
  for (const one of windows) {
    onHomeChange(one.home, () => one.changes++, one.page.signal);
    await settled();
  }
  const path = (home: string) => `/v1/homes/${home}/events`;
  assert.deepEqual(openStreams(), ["a", "b", "c"].map(path));
  await after(5000);
  assert.deepEqual(windows.map(({ changes }) => changes), [0, 0, 0, 1], "a window without a stream asks");
  windows[0]?.page.abort();
  await after(5000);
  assert.deepEqual(openStreams(), ["b", "c", "d"].map(path));
  await after(60_000);
  assert.deepEqual(windows.map(({ changes }) => changes), [0, 0, 0, 2], "a window with a stream waits for its events");
  for (const { page } of windows) page.abort();
  assert.deepEqual(openStreams(), []);
});

test("a job is read now and then while its window has no stream for it", async () => {
  const page = new AbortController();
  for (const home of ["a", "b", "c"]) onHomeChange(home, () => {}, page.signal);
  await settled();
  let [reads, progress] = [0, 0];
  const job = { id: "j", state: "running" } as Job;
  const window = new AbortController();
  const followed = new Followed(({ progress: now }) => void (progress = now), () => {
    reads++;
    followed.follow([job]);
  }, window.signal);
  followed.follow([job]);
  followed.follow([job]);
  await after(5000);
  await after(5000);
  assert.deepEqual([reads, openStreams().length], [2, 3]);
  page.abort();
  await after(5000);
  assert.deepEqual([reads, openStreams()], [3, ["/v1/jobs/j/events"]]);
  streams.at(-1)?.dispatchEvent(new MessageEvent("job", { data: JSON.stringify({ progress: 0.5 }) }));
  await after(60_000);
  assert.deepEqual([reads, progress], [3, 0.5]);
  window.abort();
  assert.deepEqual(openStreams(), []);
});

test("a page whose device is online again waits for nothing", async () => {
  const page = new AbortController();
  let [changes, reads] = [0, 0];
  onHomeChange("h", () => changes++, page.signal);
  const list = new Repeated(async () => (reads++, 30_000), page.signal);
  list.again();
  await settled();
  for (let refusals = 0; refusals < 5; refusals++) {
    streams.at(-1)?.close();
    streams.at(-1)?.dispatchEvent(new Event("error"));
    if (refusals < 4) await after(48_000);
  }
  const [opened, before] = [streams.length, reads];
  dispatchEvent(new Event("online"));
  await settled();
  assert.deepEqual([streams.length, openStreams().length, reads], [opened + 1, 1, before + 1]);
  streams.at(-1)?.dispatchEvent(new Event("open"));
  assert.equal(changes, opened);
  // A stream of the network before may be dead without an error.
  dispatchEvent(new Event("online"));
  await settled();
  assert.deepEqual([streams.length, openStreams().length], [opened + 2, 1]);
  Object.assign(document, { hidden: true });
  document.dispatchEvent(new Event("visibilitychange"));
  dispatchEvent(new Event("online"));
  await settled();
  assert.deepEqual([openStreams(), reads], [[], before + 2], "a page that nobody looks at asks");
  page.abort();
});
