// The page's addresses: everything after the `#`, so that the service serves one page.

export type Route =
  | { page: "homes"; after: string | null }
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
  if (parts.length === 0) return { page: "homes", after: new URLSearchParams(query).get("after") };
  if (first !== "homes" || !home) return { page: "nowhere" };
  if (parts.length === 2) return { page: "home", home, view: new URLSearchParams(query) };
  if (parts.length === 4 && second === "clips" && clip) return { page: "clip", home, clip };
  return { page: "nowhere" };
}

export function toHomes(after: string | null = null): string {
  return after ? `#/?after=${encodeURIComponent(after)}` : "#/";
}

export function toHome(home: string, view?: URLSearchParams): string {
  const query = view?.toString() ?? "";
  return `#/homes/${encodeURIComponent(home)}${query ? `?${query}` : ""}`;
}

export function toClip(home: string, clip: string): string {
  return `${toHome(home)}/clips/${encodeURIComponent(clip)}`;
}
