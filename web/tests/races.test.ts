import { body, fake, until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { h } from "../src/dom.ts";
import type { HomeData } from "../src/home/data.ts";
import { RemovedPanel } from "../src/home/removed.ts";
import { showHomes } from "../src/pages/homes.ts";
import { PlanView } from "../src/plan/view.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));
const never = new AbortController().signal;

/** A service that answers in the order that a test chooses. */
function held() {
  const open: { path: string; answer: (value: unknown, status?: number) => void }[] = [];
  globalThis.fetch = (path) => new Promise((resolve) =>
    open.push({ path: String(path), answer: (value, status = 200) => resolve(new Response(JSON.stringify(value), { status })) }));
  return open;
}

test("a list of removed objects that comes late does not replace the newer one", async () => {
  const open = held();
  const data = { home: { id: "h" }, map: { revision: 1 }, removals: 0 };
  const panel = new RemovedPanel(data as unknown as HomeData, () => {}, never);
  Object.assign(panel.element, { closest: () => ({ open: true }) });
  const removed = (...ids: string[]) => ({ objects: ids.map((id) => ({ id, name: id, hidden: true, class: null, corrected_at: "" })) });
  const text = () => fake(panel.element).textContent;
  const first = panel.draw();
  data.removals = 1;
  const second = panel.draw();
  open[1]?.answer(removed());
  await second;
  assert.equal(text(), "No object is removed.");
  open[0]?.answer(removed("sofa-1"));
  await first;
  assert.equal(text(), "No object is removed.");
  // Nor does a failure that comes late.
  data.removals = 2;
  const third = panel.draw();
  data.removals = 3;
  const fourth = panel.draw();
  open[3]?.answer(removed("lamp-1"));
  await fourth;
  open[2]?.answer({}, 503);
  await third;
  assert.match(text(), /^lamp-1/);
});

test("a home that is made late does not call a person back from another page", async () => {
  for (const [isLeft, hash] of [[false, "#/homes/flat"], [true, "#/homes/other"]] as const) {
    const page = new AbortController();
    Object.assign(globalThis, { location: { hash: "#/" } });
    const main = h("main");
    body.replaceChildren(fake(main));
    globalThis.fetch = async () => new Response(JSON.stringify({ items: [], next: null }));
    await showHomes({ main, crumbs: h("nav"), signal: page.signal, again: () => {} }, { text: "", attention: false, after: null });
    const open = held();
    const form = fake(main).all("form").find(({ className }) => className === "new-home");
    const [name] = form?.all("input") ?? [];
    assert.ok(form && name);
    name.value = "Flat";
    form.dispatchEvent(new Event("submit", { cancelable: true }));
    await until(() => open.length === 1);
    if (isLeft) {
      page.abort();
      location.hash = "#/homes/other";
    }
    const [button] = form.all("button");
    open[0]?.answer({}, 201);
    await until(() => button?.getAttribute("aria-disabled") === null);
    assert.equal(location.hash, hash);
  }
});

test("the picture of a new LiDAR map has another address", async () => {
  Object.assign(globalThis, { location: { hash: "#/" } });
  const clips_by_state = { uploaded: 0, queued: 0, aligning: 0, aligned: 0, ambiguous: 0, failed: 0 };
  const pictures = new Set<string | null>();
  for (const lidar_map_revision of [1, 2]) {
    const home = { id: "flat", name: null, clips: 0, clips_by_state, needs_attention: [], map_state: "current", updated_at: "", lidar_map_revision };
    globalThis.fetch = async () => new Response(JSON.stringify({ items: [home], next: null }));
    const [main, page] = [h("main"), new AbortController()];
    await showHomes({ main, crumbs: h("nav"), signal: page.signal, again: () => {} }, { text: "", attention: false, after: null });
    page.abort();
    const [picture] = fake(main).all("img");
    pictures.add(picture?.getAttribute("src") ?? null);
  }
  assert.deepEqual([...pictures], [1, 2].map((revision) => `/v1/homes/flat/lidar-map/image.png?revision=${revision}`));
});

test("only the main button of a mouse drags the plan", () => {
  Object.assign(globalThis, { ResizeObserver: class { observe(): void {} } });
  const plan = new PlanView("", never);
  Object.assign(plan.element, { setPointerCapture: () => {} });
  plan.setBounds({ min: [0, 0], max: [4, 3] });
  const send = (name: string, button: number, clientX: number) =>
    plan.element.dispatchEvent(Object.assign(new Event(name), { button, clientX, clientY: 0, pointerId: 1 }));
  const window = () => plan.element.getAttribute("viewBox");
  const before = window();
  // A menu takes the release of its button.
  send("pointerdown", 2, 0);
  send("pointermove", -1, 50);
  assert.equal(window(), before);
  send("pointerdown", 0, 0);
  send("pointermove", -1, 50);
  assert.notEqual(window(), before);
});

test("a plan that is moved by keys gets them from a screen reader", () => {
  Object.assign(globalThis, { ResizeObserver: class { observe(): void {} } });
  assert.deepEqual([never, null].map((signal) => new PlanView("", signal).element.getAttribute("role")), ["application", "img"]);
});
