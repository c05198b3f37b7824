// The page's addresses: everything after the `#`, so the service serves one page.

/** The part of all homes that a list shows. */
export interface Asked {
  /** Text in the id or name; empty for all. */
  text: string;
  /** Only homes that a person should look at. */
  attention: boolean;
  /** The last home of the page before. */
  after: string | null;
}

const ALL: Asked = { text: "", attention: false, after: null };

type Route =
  | { page: "homes"; asked: Asked }
  | { page: "home"; home: string; view: URLSearchParams }
  | { page: "clip"; home: string; clip: string }
  | { page: "nowhere" };

/** The address in `location.hash`. */
export function parse(hash: string): Route {
  const [path = "", query = ""] = hash.replace(/^#/, "").split("?", 2);
  let parts: string[];
  try {
    parts = path.split("/").filter(Boolean).map(decodeURIComponent);
  } catch {
    return { page: "nowhere" };
  }
  const [first, home, second, clip] = parts;
  if (parts.length === 0 || (parts.length === 1 && first === "homes")) return { page: "homes", asked: askedBy(query) };
  if (first !== "homes" || !home) return { page: "nowhere" };
  if (parts.length === 2) return { page: "home", home, view: new URLSearchParams(query) };
  if (parts.length === 4 && second === "clips" && clip) return { page: "clip", home, clip };
  return { page: "nowhere" };
}

function askedBy(query: string): Asked {
  const given = new URLSearchParams(query);
  return { text: given.get("q") ?? "", attention: given.has("needs_attention"), after: given.get("after") };
}

export function toHomes(asked: Asked = ALL): string {
  const query = homesQuery(asked).toString();
  return query ? `#/?${query}` : "#/";
}

/** The query of the API and of the page. */
export function homesQuery({ text, attention, after }: Asked): URLSearchParams {
  const query = new URLSearchParams();
  if (text) query.set("q", text);
  if (attention) query.set("needs_attention", "true");
  if (after) query.set("after", after);
  return query;
}

export function toHome(home: string, view?: URLSearchParams): string {
  const query = view?.toString() ?? "";
  return `#/homes/${encodeURIComponent(home)}${query ? `?${query}` : ""}`;
}

export function toClip(home: string, clip: string): string {
  return `${toHome(home)}/clips/${encodeURIComponent(clip)}`;
}
