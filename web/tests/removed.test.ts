import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { HomeData } from "../src/home/data.ts";
import { Looks } from "../src/home/looks.ts";
import { Losses } from "../src/home/losses.ts";
import type { Clip, Thing } from "../src/types.ts";

const real = { fetch: globalThis.fetch };
afterEach(() => void Object.assign(globalThis, real));
const never = new AbortController().signal;

/** A home with two objects. `hidden` has the removed ones, `asked` the paths of the requests. */
async function homeWithObjects() {
  const service = { revision: 1, objects: ["sofa-1", "desk-1"], hidden: new Set<string>(), levels: ["main"], asked: [] as string[], meanwhile: () => {} };
  const map = () => ({ revision: service.revision, created_at: "", clips: [], info: {}, levels: [{ level: "main", info: {} }] });
  const answers: Record<string, () => unknown> = {
    "": () => ({ id: "h" }), "/lidar-maps": () => ({ items: service.levels.map((level) => ({ level })) }), "/clips": () => ({ items: [], next: null }),
    "/map": map, "/map/rooms": () => ({ rooms: [] }), "/map/coverage": () => ({}),
    "/map/objects": () => ({ objects: service.objects.map((id) => ({ id, level: "main", class: id.replace(/-.*/, ""), name: null })) }),
    "/map/corrections": () => ({ objects: [...service.hidden].map((id) => ({ id, hidden: true })), rooms: [] }),
    "/v1/classes": () => ({ classes: [] }),
  };
  globalThis.fetch = async (path) => {
    const short = String(path).replace("/v1/homes/h", "").replace(/\?.*/, "");
    service.asked.push(short);
    const answer = JSON.stringify(answers[short]?.());
    if (short === "/map/corrections") service.meanwhile();
    return new Response(answer);
  };
  const data = await HomeData.load("h", null, never);
  const remove = (id: string) => {
    service.hidden.add(id);
    data.remove({ id, level: "main" } as Thing);
  };
  return { service, data, remove, shown: () => data.things.map(({ id }) => id).sort() };
}

test("an object that was removed here and brought back elsewhere is shown again", async () => {
  const { service, data, remove, shown } = await homeWithObjects();
  remove("sofa-1");
  await data.refresh(never);
  assert.deepEqual(shown(), ["desk-1"], "the newest map still has it");
  const drawn = data.drawn;
  service.hidden.clear();
  // A merge without a change makes no revision.
  await data.refresh(never);
  assert.deepEqual(shown(), ["desk-1", "sofa-1"]);
  assert.notEqual(data.drawn, drawn, "the scene is not drawn again");
});

test("an object that was brought back elsewhere is shown once with the next map", async () => {
  const { service, data, remove, shown } = await homeWithObjects();
  remove("sofa-1");
  service.hidden.clear();
  service.revision = 2;
  await data.refresh(never);
  assert.deepEqual(shown(), ["desk-1", "sofa-1"]);
});

test("an object that is removed while the corrections are read stays removed", async () => {
  const { service, data, remove, shown } = await homeWithObjects();
  remove("sofa-1");
  service.meanwhile = () => {
    service.meanwhile = () => {};
    remove("desk-1");
  };
  await data.refresh(never);
  assert.deepEqual(shown(), []);
});

test("corrections are read only while the map still has a removed object", async () => {
  const { service, data, remove, shown } = await homeWithObjects();
  const readings = () => service.asked.filter((path) => path === "/map/corrections").length;
  assert.equal(readings(), 0);
  remove("sofa-1");
  service.objects = ["desk-1"];
  service.revision = 2;
  await data.refresh(never);
  await data.refresh(never);
  assert.deepEqual([shown(), readings()], [["desk-1"], 0]);
});

test("what another tab deletes is told, and what this one deletes is not", async () => {
  const { service, data } = await homeWithObjects();
  const clips = (...ids: string[]) => ids.map((id) => ({ id, title: id, file_name: null })) as unknown as Clip[];
  data.clips = clips("Kitchen", "Hall", "Bath", "Attic", "Cellar", "Garden");
  const looks = new Looks();
  const losses = new Losses(data, looks);
  assert.deepEqual(losses.told(), []);
  await data.deleting("Hall", async () => {});
  await assert.rejects(data.deleting("Bath", () => Promise.reject(new Error("lost"))));
  data.clips = clips("Attic", "Cellar", "Garden", "Bath");
  assert.deepEqual(losses.told(), ["Kitchen was deleted in another tab or by another person."]);
  assert.deepEqual(losses.told(), []);
  data.clips = [];
  assert.deepEqual(losses.told(), ["4 clips were deleted in another tab or by another person."]);
  looks.select({ kind: "object", id: "sofa-1" });
  [service.objects, service.revision] = [["desk-1"], 2];
  await data.refresh(never);
  assert.deepEqual(losses.told(), ["Sofa is no longer in the map."]);
  looks.select({ kind: "object", id: "desk-1" });
  looks.select(null);
  [service.objects, service.revision] = [[], 3];
  await data.refresh(never);
  assert.deepEqual(losses.told(), [], "nobody looks at it");
});

test("the level that another tab deletes is told", async () => {
  const { service, data } = await homeWithObjects();
  const losses = new Losses(data, new Looks());
  service.levels = ["upper"];
  await data.refresh(never);
  assert.deepEqual([data.level, losses.told()], ["upper", ["The level “Main” was deleted in another tab or by another person."]]);
});
