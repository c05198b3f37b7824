// Talks to the service, which is always the host that this page came from.

import { wordsFor } from "./problems.ts";
import { type Asked, homesQuery } from "./route.ts";
import { idOf } from "./words.ts";
import type {
  Class, Clip, Corrections, Coverage, Home, HomeMap, LidarMap, LidarRevision, List, MapChanges, Room, RoomPatch, Scan, Session,
  Thing, ThingPatch, Upload,
} from "./types.ts";

/** Time until a document must be complete. */
const LONGEST_READ_MS = 60_000;
/** Time until an action must be answered: the service deletes the files of a large home before it answers. */
const LONGEST_ACTION_MS = 120_000;
const UNANSWERED = "The service did not answer. It may have done it all the same: look before you do it again.";
/** Ids that are tried for a new home. */
const MOST_IDS = 5;

/** The explanations of answers without a problem document: none came, or a proxy before the service made it. */
const WITHOUT_DOCUMENT: Record<number, string> = {
  0: "The service does not answer.",
  413: "A proxy before the service does not take a request of this size. Tell the person who runs the service.",
};

/** The service said no; the message is its own explanation. */
export class Refusal extends Error {
  constructor(
    readonly status: number,
    message: string,
    /** The service's own delay until the next attempt, if it gave one. */
    readonly retryAfter_s: number | null = null,
    /** The service's own words, if the message is the page's. */
    readonly detail: string | null = null,
    /** True if the service itself refused, and not a proxy before it. */
    readonly isOwn = false,
  ) {
    super(message);
  }

  /** True if asking again gives the same answer: the session has ended, or what was asked for is gone. */
  get isFinal(): boolean {
    return [401, 403, 404].includes(this.status);
  }
}

/** The explanation of a problem document in the words of the page, else in its own; the status where there is none. */
export function explanation(status: number, body: string): string {
  return refusalOf(status, body, null).message;
}

/** The refusal of an answer that is no success. */
export function refusalOf(status: number, body: string, retryAfter: string | null): Refusal {
  const delay = delay_s(retryAfter);
  try {
    const problem: unknown = JSON.parse(body);
    if (typeof problem === "object" && problem !== null) {
      const { type, field, detail, title } = problem as { type?: unknown; field?: unknown; detail?: unknown; title?: unknown };
      const own = [detail, title].find((text): text is string => typeof text === "string" && text !== "");
      const words = wordsFor(type, field);
      const isOwn = String(type).startsWith("urn:viola:problem:");
      if (words) return new Refusal(status, words, delay, own ?? null, isOwn);
      if (own) return new Refusal(status, own, delay, null, isOwn);
    }
  } catch {
    // Not a problem document: something between this page and the service answered.
  }
  return new Refusal(status, WITHOUT_DOCUMENT[status] ?? `The service answered with status ${status}.`, delay);
}

/** The seconds of a header `Retry-After`; null if it is missing or a date. */
function delay_s(retryAfter: string | null): number | null {
  return /^\d+$/.test(retryAfter ?? "") ? Number(retryAfter) : null;
}

let onAnswered = (): void => {};

/** Calls back after each answer of the service that is no failure. */
export function onAnswer(listen: () => void): void {
  onAnswered = listen;
}

async function ask(path: string, options: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, options);
  } catch (error) {
    if (options.signal?.aborted) throw error;
    throw new Refusal(0, `${explanation(0, "")} Check the network of this device.`);
  }
  // 304 comes only to a request with a condition.
  if (answer.ok || answer.status === 304) {
    onAnswered();
    return answer;
  }
  // The status tells enough if the explanation is lost.
  throw refusalOf(answer.status, await answer.text().catch(() => ""), answer.headers.get("retry-after"));
}

/** No answer came, or only a part of one. */
export function lost(): Refusal {
  return new Refusal(0, explanation(0, ""));
}

/** Reads an answer with its headers. One that stalls, breaks off or is not what it should be counts as none. */
async function read<T>(path: string, signal: AbortSignal, take: (answer: Response) => Promise<T>): Promise<[T, Headers]> {
  const limit = AbortSignal.timeout(LONGEST_READ_MS);
  try {
    const answer = await ask(path, { signal: AbortSignal.any([signal, limit]) });
    return [await take(answer), answer.headers];
  } catch (error) {
    throw signal.aborted || error instanceof Refusal ? error : lost();
  }
}

const json = <T>(answer: Response) => answer.json() as Promise<T>;

async function get<T>(path: string, signal: AbortSignal): Promise<T> {
  return (await read(path, signal, json<T>))[0];
}

export async function picture(path: string, signal: AbortSignal): Promise<Blob> {
  return (await read(path, signal, (answer) => answer.blob()))[0];
}

/** The answer with a large file, which may take its time. Its status is 304 if the file is the one with the `ETag` that is known. */
export function file(path: string, known: string | null, signal?: AbortSignal): Promise<Response> {
  return ask(path, { headers: known ? { "if-none-match": known } : {}, signal });
}

/** Null where there is nothing (404). */
async function ifThere<T>(asked: Promise<T>): Promise<T | null> {
  try {
    return await asked;
  } catch (error) {
    if (error instanceof Refusal && error.status === 404) return null;
    throw error;
  }
}

/** Sends an action. One that stalls ends: its button would rest for ever. */
async function send(method: string, path: string, body?: unknown, headers: Record<string, string> = {}): Promise<Response> {
  const limit = AbortSignal.timeout(LONGEST_ACTION_MS);
  const options: RequestInit = { method, headers, signal: limit };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers = { ...headers, "content-type": "application/json" };
  }
  try {
    const answer = await ask(path, options);
    // Its status says that it is done, also if the rest of the answer is lost. Reading it frees the connection.
    await answer.text().catch(() => {});
    return answer;
  } catch (error) {
    if (limit.aborted && !(error instanceof Refusal)) throw new Refusal(0, UNANSWERED);
    throw error;
  }
}

/** Begins a session with a key; its token goes into a cookie. */
export async function signIn(key: string): Promise<void> {
  await send("PUT", "/v1/session", { key });
}

/** Ends the session of this browser. */
export async function signOut(): Promise<void> {
  await send("DELETE", "/v1/session");
}

/** The tenant and the role of this browser's key. */
export function session(signal: AbortSignal): Promise<Session> {
  return get("/v1/session", signal);
}

/** The path of a home, or of something below it. */
export function homePath(home: string, ...rest: string[]): string {
  return ["/v1/homes", encodeURIComponent(home), ...rest].join("/");
}

export function clipPath(clip: { home: string; id: string }, ...rest: string[]): string {
  return homePath(clip.home, "clips", clip.id, ...rest);
}

export function homes(asked: Asked, signal: AbortSignal): Promise<List<Home>> {
  const query = homesQuery(asked);
  query.set("limit", "48");
  return get(`/v1/homes?${query}`, signal);
}

export function home(id: string, signal: AbortSignal): Promise<Home> {
  return get(homePath(id), signal);
}

/** The new home whose answer was lost: it may have been made. */
let unanswered: { name: string; id: string } | null = null;

/**
 * Makes a home and returns its id, which is made of its name, with random letters if another home has it. A repetition after a
 * lost answer returns the home that was made then.
 */
export async function makeHome(name: string): Promise<string> {
  const asked = unanswered?.name === name ? unanswered.id : null;
  for (let tries = 1; ; tries++) {
    const id = tries === 1 ? (asked ?? idOf(name)) : `${idOf(name)}-${randomLetters()}`;
    if ((await isNewHome(name, id)) || (id === asked && (await isUnused(name, id)))) {
      unanswered = null;
      return id;
    }
    if (tries === MOST_IDS) throw new Error("Other homes have the ids of this name. Choose another name.");
  }
}

/** Makes a home; false if another one has this id. */
async function isNewHome(name: string, id: string): Promise<boolean> {
  try {
    // 200 and 412: another home has this id.
    return (await send("PUT", homePath(id), { name }, { "if-none-match": "*" })).status === 201;
  } catch (error) {
    if (error instanceof Refusal && error.status === 412) return false;
    const isLost = !(error instanceof Refusal) || error.status === 0 || error.status >= 500;
    if (isLost) unanswered = { name, id };
    throw error;
  }
}

/** Returns whether a home with this id has the name and nothing else: it is the one that was made, or as good as it. */
async function isUnused(name: string, id: string): Promise<boolean> {
  const found = await ifThere(get<Home>(homePath(id), new AbortController().signal));
  return found !== null && found.name === name && found.clips === 0 && found.lidar_map_revision === null;
}

function randomLetters(): string {
  return [...crypto.getRandomValues(new Uint8Array(4))].map((value) => String.fromCharCode(97 + (value % 26))).join("");
}

/** Gives a home another name; null takes its name away. */
export async function renameHome(id: string, name: string | null): Promise<void> {
  await send("PUT", homePath(id), { name });
}

export async function deleteHome(id: string): Promise<void> {
  await send("DELETE", homePath(id));
}

/** The LiDAR maps of a home, one for each level, by the levels' names. */
export async function lidarMaps(id: string, signal: AbortSignal): Promise<LidarMap[]> {
  const answer: { items: LidarMap[] } = await get(homePath(id, "lidar-maps"), signal);
  return answer.items;
}

/** The path of the LiDAR map of a level, or of something below it. */
export function lidarPath(id: string, level: string, ...rest: string[]): string {
  return homePath(id, "lidar-maps", encodeURIComponent(level), ...rest);
}

/** Makes an earlier LiDAR map of a level the current one again. */
export async function restoreLidarMap(id: string, level: string, revision: number): Promise<void> {
  await send("POST", lidarPath(id, level, "revisions", String(revision), "restore"));
}

/** The revisions of a level's LiDAR map, the newest first. */
export async function lidarRevisions(id: string, level: string, signal: AbortSignal): Promise<LidarRevision[]> {
  const page: List<LidarRevision> = await get(lidarPath(id, level, "revisions?limit=50"), signal);
  return page.items;
}

/** Removes the LiDAR maps of a level, and the choices and corrections on it. */
export async function deleteLevel(id: string, level: string): Promise<void> {
  await send("DELETE", lidarPath(id, level));
}

/** An upload in parts, by its path; null if the service does not have it any more. */
export function upload(path: string, signal: AbortSignal): Promise<Upload | null> {
  return ifThere(get(path, signal));
}

/** The clips of a home that are being aligned: as many as there are workers. */
export async function clipsAtWork(home: string, signal: AbortSignal): Promise<Clip[]> {
  const page: List<Clip> = await get(homePath(home, "clips?state=aligning&limit=200"), signal);
  return page.items;
}

/** All clips of a home, the oldest first. */
export async function clips(home: string, signal: AbortSignal): Promise<Clip[]> {
  const items: Clip[] = [];
  let after: string | null = null;
  do {
    const cursor: string = after ? `&after=${encodeURIComponent(after)}` : "";
    const page: List<Clip> = await get(homePath(home, `clips?limit=200${cursor}`), signal);
    items.push(...page.items);
    after = page.next;
  } while (after);
  return items;
}

/** The `ETag` of each clip that was read alone: a choice is about the clip as a person saw it. */
const tags = new WeakMap<Clip, string>();

export async function clip(home: string, id: string, signal: AbortSignal): Promise<Clip> {
  const [clip, headers] = await read(homePath(home, "clips", id), signal, json<Clip>);
  const tag = headers.get("etag");
  if (tag) tags.set(clip, tag);
  return clip;
}

export function clipIfThere(home: string, id: string, signal: AbortSignal): Promise<Clip | null> {
  return ifThere(clip(home, id, signal));
}

/** Gives a clip another name; null shows its file name again. */
export async function renameClip(clip: Clip, title: string | null): Promise<void> {
  await send("PATCH", clipPath(clip), { title });
}

export async function deleteClip(clip: Clip): Promise<void> {
  await send("DELETE", clipPath(clip));
}

export async function alignAgain(clip: Clip): Promise<void> {
  await send("POST", clipPath(clip, "align"));
}

export async function cancelJob(id: string): Promise<void> {
  await send("POST", `/v1/jobs/${encodeURIComponent(id)}/cancel`);
}

export async function choose(clip: Clip, alternative: number): Promise<void> {
  const tag = tags.get(clip);
  await send("PUT", clipPath(clip, "alignment"), { alternative }, tag ? { "if-match": tag } : {});
}

export async function withdraw(clip: Clip): Promise<void> {
  await send("DELETE", clipPath(clip, "alignment"));
}

export function scan(home: string, clip: string, signal: AbortSignal): Promise<Scan | null> {
  return ifThere(get(homePath(home, "clips", clip, "scan"), signal));
}

/** The newest map. */
export function homeMap(home: string, signal: AbortSignal): Promise<HomeMap | null> {
  return ifThere(get(homePath(home, "map"), signal));
}

export async function rooms(home: string, signal: AbortSignal): Promise<Room[]> {
  const answer: { rooms: Room[] } | null = await ifThere(get(homePath(home, "map", "rooms"), signal));
  return answer?.rooms ?? [];
}

export async function things(home: string, signal: AbortSignal): Promise<Thing[]> {
  const answer: { objects: Thing[] } | null = await ifThere(get(homePath(home, "map", "objects"), signal));
  return answer?.objects ?? [];
}

/** The fraction of a level's LiDAR map that the clips explain, as a whole and by room; null without a map. */
export function coverage(home: string, level: string, signal: AbortSignal): Promise<Coverage | null> {
  return ifThere(get(homePath(home, "map", `coverage?level=${encodeURIComponent(level)}`), signal));
}

/** The revisions of the map that are kept, the newest first. */
export async function revisions(home: string, signal: AbortSignal): Promise<HomeMap[]> {
  const page: List<HomeMap> = await get(homePath(home, "map", "revisions?limit=50"), signal);
  return page.items;
}

/** The changes of objects between two revisions of the map. */
export function changes(home: string, from: number, to: number, signal: AbortSignal): Promise<MapChanges> {
  return get(homePath(home, "map", `changes?from=${from}&to=${to}`), signal);
}

/** All corrections of a home. */
export function corrections(home: string, signal: AbortSignal): Promise<Corrections> {
  return get(homePath(home, "map", "corrections"), signal);
}

export async function correctThing(home: string, id: string, patch: ThingPatch): Promise<void> {
  await send("PATCH", homePath(home, "map", "objects", encodeURIComponent(id)), patch);
}

export async function correctRoom(home: string, id: string, patch: RoomPatch): Promise<void> {
  await send("PATCH", homePath(home, "map", "rooms", encodeURIComponent(id)), patch);
}

let known: Promise<Class[]> | null = null;

/** The classes of points; they do not change while the service runs. */
export function classes(): Promise<Class[]> {
  known ??= get<{ classes: Class[] }>("/v1/classes", new AbortController().signal).then(
    (answer) => answer.classes,
    (error: unknown) => {
      known = null;
      throw error;
    },
  );
  return known;
}
