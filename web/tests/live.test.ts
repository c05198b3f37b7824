import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { onHomeChange } from "../src/parts/live.ts";

test("a stream that is lost and does not come back counts as a change", () => {
  const streams: FakeStream[] = [];
  class FakeStream extends EventTarget {
    static readonly CLOSED = 2;
    readyState = 0;
    constructor() {
      super();
      streams.push(this);
    }
    close(): void {}
  }
  const document = Object.assign(new EventTarget(), { hidden: false });
  Object.assign(globalThis, { EventSource: FakeStream, document, window: globalThis });
  mock.timers.enable({ apis: ["setTimeout"] });
  const page = new AbortController();
  let changes = 0;
  onHomeChange("h", () => changes++, page.signal);
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
  mock.timers.reset();
});
