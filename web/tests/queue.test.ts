import { body, fake, kept, until } from "./dom.ts";
import assert from "node:assert/strict";
import { afterEach, beforeEach, test } from "node:test";
import type { HomeData } from "../src/home/data.ts";
import { clearNotices, noticeBoard } from "../src/parts/notices.ts";
import { onSessionEnd } from "../src/session.ts";
import { askTarget } from "../src/upload/level.ts";
import { UploadPanel } from "../src/upload/panel.ts";
import { Unfinished } from "../src/upload/unfinished.ts";
import { resumeUploads, stopUploads, unsentFiles, UploadQueue, queueOf } from "../src/upload/queue.ts";
import { type Answer, answerRequests, type Asked } from "./request.ts";

const PART_BYTES = 8 << 20;
const ONLINE = "online";

interface Upload {
  length: number;
  offset: number;
  state: "arriving" | "arrived" | "finished" | "refused";
  problem?: object;
}

/** The uploads of a service. */
class Service {
  readonly seen: string[] = [];
  readonly uploads = new Map<string, Upload>();
  hasSession = true;
  /** True if a reader takes its time for each complete file. */
  isSlow = false;
  /** The request whose connection breaks. */
  loses = "";

  answer({ method, path, headers, bytes }: Asked): Answer {
    const at = headers.get("upload-offset");
    const name = [method, path.split("/").pop(), at].filter(Boolean).join(" ");
    this.seen.push(name);
    if (!this.hasSession) return { status: 401, body: "{}" };
    if (name === this.loses) return { status: 0 };
    if (method === "POST") {
      const made = `/v1/uploads/${this.uploads.size + 1}`;
      this.uploads.set(made, { length: Number(headers.get("upload-length")), offset: 0, state: "arriving" });
      return { status: 201, headers: { location: made } };
    }
    const upload = this.uploads.get(path);
    if (!upload) return { status: 404, body: "{}" };
    upload.offset += bytes;
    if (upload.offset === upload.length && upload.state === "arriving") upload.state = this.isSlow ? "arrived" : "finished";
    const clip: Record<string, string> = upload.state === "finished" ? { "viola-clip": "/v1/homes/h/clips/c" } : {};
    return { status: 200, headers: { "upload-offset": String(upload.offset), ...clip } };
  }
}

const real = { XMLHttpRequest: globalThis.XMLHttpRequest, fetch: globalThis.fetch };
let service = new Service();
let queue = new UploadQueue("h");
let done = 0;
/** Requests for a sign-in; a page of any home may be shown. */
let asked = 0;
onSessionEnd(() => asked++);

/** Opens the page of the home. */
function open(): void {
  queue = new UploadQueue("h");
  queue.onDone = () => done++;
  body.replaceChildren(fake(queue.list));
}

beforeEach(() => {
  service = new Service();
  [done, asked] = [0, 0];
  kept.clear();
  answerRequests((asked) => service.answer(asked));
  globalThis.fetch = (path) => {
    const upload = service.uploads.get(String(path));
    const body = JSON.stringify({ state: upload?.state, received_bytes: upload?.offset, problem: upload?.problem ?? null });
    return Promise.resolve(new Response(body, { status: upload ? 200 : 404 }));
  };
  open();
});
afterEach(() => {
  queue.stop();
  Object.assign(globalThis, real);
});

const fileOf = (name: string, bytes = 10) => new File([new Uint8Array(bytes)], name, { lastModified: 5 });
const rows = () => fake(queue.list).all("li").map((row) => row.textContent);

test("a file that the service still reads does not hold up the next one", async () => {
  service.isSlow = true;
  queue.addClip(fileOf("slow.zip"));
  await until(() => rows()[0]?.includes("is being read") ?? false);
  service.isSlow = false;
  queue.addClip(fileOf("next.zip"));
  await until(() => done === 1);
  assert.equal(rows().length, 1);
  assert.match(rows()[0] ?? "", /slow\.zip.*is being read/);
  assert.equal(queue.unsent, 0);
  for (const upload of service.uploads.values()) upload.state = "finished";
  // Ends the pause.
  dispatchEvent(new Event(ONLINE));
  await until(() => done === 2);
  assert.deepEqual(rows(), []);
  assert.equal(kept.size, 0);
});

test("a file that is added again after a reload resumes, and makes one clip", async () => {
  const file = await interrupted();
  queue.addClip(file);
  await until(() => done === 1);
  assert.deepEqual(service.seen, ["HEAD 1", `PATCH 1 ${PART_BYTES}`]);
  assert.equal(kept.size, 0, "a stored file is sent anew");
});

test("a file that is in the queue already is another clip, and so is one after a sign-out", async () => {
  const file = fileOf("kitchen.zip");
  service.isSlow = true;
  queue.addClip(file);
  await until(() => rows()[0]?.includes("is being read") ?? false);
  queue.addClip(file);
  await until(() => rows()[1]?.includes("is being read") ?? false);
  assert.equal(service.uploads.size, 2);
  queue.stop();
  stopUploads();
  open();
  queue.addClip(file);
  await until(() => rows()[0]?.includes("is being read") ?? false);
  assert.equal(service.uploads.size, 3);
});

test("maps go before clips, and the map that a person added last replaces the earlier one", async () => {
  for (const name of ["first.zip", "next.zip"]) queue.addClip(fileOf(name));
  for (const name of ["old", "new"]) queue.addMap(fileOf(name), { level: "main", replaces: null });
  await until(() => queue.unsent === 0);
  const sent = service.seen.filter((name) => /^(POST|PUT)/.test(name));
  assert.deepEqual(sent, ["POST uploads", "PUT main?filename=old", "PUT main?filename=new", "POST uploads"]);
});

test("a page that was left explains no refused files over the next one", async () => {
  const page = new AbortController();
  const panel = new UploadPanel({ home: { id: "asked" } } as unknown as HomeData, () => {}, page.signal);
  const photo = new File([new Uint8Array([0xff, 0xd8, 0xff])], "kitchen.jpg");
  const [clips] = fake(panel.element).all("input");
  Object.assign(clips ?? {}, { files: [photo, fileOf("map.json")] });
  clips?.dispatchEvent(new Event("change"));
  await until(() => body.all("dialog").length === 1);
  assert.match(body.all("dialog")[0]?.textContent ?? "", /^A LiDAR map\?/);
  // The end of the page closes its question.
  page.abort();
  body.all("dialog")[0]?.dispatchEvent(new Event("close"));
  await new Promise((resolve) => setTimeout(resolve, 5));
  assert.deepEqual(body.all("dialog"), []);
});

test("in a home with all levels a mere Enter replaces no map", () => {
  const buttons = (levels: number) => {
    const taken = Array.from({ length: levels }, (_, i) => `level-${i}`);
    void askTarget(fileOf("map.json"), { level: "level-0", replaces: 1 }, taken);
    return body.all("dialog").at(-1)?.all("button").map((button) => [button.textContent, button.getAttribute("autofocus")]);
  };
  assert.deepEqual(buttons(8), [["Cancel", ""], ["Replace map", null]]);
  // The field of the name has the focus.
  assert.deepEqual(buttons(7), [["Add level", null], ["Replace map", null], ["Cancel", null]]);
});

test("files wait for the next session", async () => {
  service.hasSession = false;
  for (const name of ["first.zip", "next.zip"]) queue.addClip(fileOf(name));
  await until(() => rows()[0]?.includes("waits for the sign-in") ?? false);
  assert.deepEqual(service.seen, ["POST uploads"]);
  assert.deepEqual([done, asked], [0, 1]);
  assert.equal(queue.unsent, 2);
  service.hasSession = true;
  queue.resume();
  await until(() => done === 2);
  assert.deepEqual(rows(), []);
});

test("after a new sign-in the files of all homes are sent, whatever page is shown", async () => {
  service.hasSession = false;
  for (const home of ["a", "b"]) queueOf(home).addClip(fileOf("clip.zip"));
  await until(() => asked === 2);
  assert.equal(unsentFiles(), 2);
  service.hasSession = true;
  resumeUploads();
  await until(() => unsentFiles() === 0);
  assert.equal(service.uploads.size, 2);
});

test("a queue that outlives its page keeps nothing of it in memory", async () => {
  const page = new AbortController();
  const panel = new UploadPanel({ home: { id: "left" } } as unknown as HomeData, () => done++, page.signal);
  const left = queueOf("left");
  assert.ok(fake(panel.element).contains(left.list) && fake(panel.element).contains(left.said));
  page.abort();
  assert.deepEqual([fake(left.list).parent, fake(left.said).parent], [null, null]);
  left.addClip(fileOf("clip.zip"));
  await until(() => left.unsent === 0);
  assert.equal(done, 0, "the page that was left is told");
});

test("the unsent files of all homes are counted until the sign-out", async () => {
  service.hasSession = false;
  for (const home of ["a", "b"]) queueOf(home).addClip(fileOf("clip.zip"));
  assert.equal(unsentFiles(), 2);
  stopUploads();
  assert.equal(unsentFiles(), 0);
});

/** A file whose upload was interrupted by a reload of the page. */
async function interrupted(): Promise<File> {
  const file = fileOf("kitchen.zip", 2 * PART_BYTES);
  service.loses = `PATCH 1 ${PART_BYTES}`;
  queue.addClip(file);
  await until(() => service.seen.includes(service.loses));
  queue.stop();
  open();
  [service.loses, service.seen.length] = ["", 0];
  return file;
}

function unfinished() {
  const list = new Unfinished("h", queue, new AbortController().signal);
  body.append(fake(list.element));
  const texts = () => fake(list.element).all("li").map((row) => row.textContent);
  const choose = (file: File) => {
    const [input] = fake(list.element).all("input");
    Object.assign(input ?? {}, { files: [file] });
    input?.dispatchEvent(new Event("change"));
  };
  return { list, texts, choose };
}

test("an upload that a reload interrupted is told, and continues with the same file", async () => {
  const file = await interrupted();
  const { list, texts, choose } = unfinished();
  await list.draw();
  assert.equal(texts().length, 1);
  assert.match(texts()[0] ?? "", /kitchen\.zip.*interrupted\. 50 % of 16\.8 MB has arrived\. Choose the same file/);
  assert.equal(fake(list.said).textContent, "1 upload is not finished.");
  // A person who speaks the word of the button means its field.
  const [word, name] = [fake(list.element).all("label")[0]?.textContent, fake(list.element).all("input")[0]?.getAttribute("aria-label")];
  assert.ok(word && name?.startsWith(word), `${name} is shown as ${word}`);
  choose(fileOf("kitchen.zip", PART_BYTES));
  assert.deepEqual(service.seen, [], "another file continues the upload");
  choose(file);
  await until(() => done === 1);
  assert.deepEqual(service.seen, ["HEAD 1", `PATCH 1 ${PART_BYTES}`]);
  await list.draw();
  assert.deepEqual([texts(), fake(list.element).hidden], [[], true]);
});

test("an upload that is gone, complete or sent by another tab is not told as unfinished", async () => {
  await interrupted();
  const { list, texts } = unfinished();
  const [upload] = service.uploads.values();
  assert.ok(upload);
  const [name] = kept.values();
  const { key } = Object.values(JSON.parse(name ?? "{}") as Record<string, { key: string }>)[0] ?? { key: "" };
  Object.assign(navigator, { locks: { query: async () => ({ held: [{ name: `viola upload ${key}` }] }) } });
  await list.draw();
  assert.deepEqual(texts(), [], "another tab sends it");
  Reflect.deleteProperty(navigator, "locks");
  await list.draw();
  assert.equal(texts().length, 1);
  upload.state = "arrived";
  await list.draw();
  assert.deepEqual([texts(), kept.size], [[], 1]);
  service.uploads.clear();
  await list.draw();
  assert.deepEqual([texts(), kept.size], [[], 0]);
});

test("an upload of yesterday whose last bytes are of today is told as unfinished", async () => {
  await interrupted();
  const begun = JSON.parse(kept.get("viola.uploads") ?? "{}") as Record<string, { at_ms: number }>;
  const age = (hours: number) => {
    for (const one of Object.values(begun)) one.at_ms -= hours * 3600 * 1000;
    kept.set("viola.uploads", JSON.stringify(begun));
  };
  const { list, texts } = unfinished();
  age(30);
  await list.draw();
  assert.equal(texts().length, 1);
  age(24 * 7);
  await list.draw();
  assert.deepEqual(texts(), []);
});

test("a file that was refused after its tab was closed is told once", async () => {
  await interrupted();
  const [upload] = service.uploads.values();
  const problem = { type: "urn:viola:problem:zip-truncated", status: 415, title: "The zip is cut off", detail: "its end is missing" };
  Object.assign(upload ?? {}, { state: "refused", problem });
  const board = fake(noticeBoard());
  const { list, texts } = unfinished();
  await list.draw();
  assert.match(board.textContent, /kitchen\.zip is not stored: The file is incomplete/);
  assert.deepEqual([texts(), kept.size], [[], 0]);
  clearNotices();
  await list.draw();
  assert.ok(!board.textContent.includes("kitchen.zip"));
});

test("an unfinished upload of another tenant is not told", async () => {
  await interrupted();
  kept.set("viola.uploads", (kept.get("viola.uploads") ?? "").replace('[\\"\\"', '[\\"other\\"'));
  const { list, texts } = unfinished();
  await list.draw();
  assert.deepEqual(texts(), []);
});

test("a file that another tab sends becomes a clip of its own", async () => {
  const file = await interrupted();
  let asked = 0;
  const request = async (_: string, __: object, hold: (lock: object | null) => unknown) => void hold(asked++ === 0 ? null : {});
  Object.assign(navigator, { locks: { request } });
  queue.addClip(file);
  await until(() => done === 1);
  Reflect.deleteProperty(navigator, "locks");
  assert.deepEqual([service.uploads.size, service.seen[0]], [2, "POST uploads"]);
});
