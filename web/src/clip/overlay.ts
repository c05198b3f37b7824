// The picture `overlay.png` in words. Its legend is drawn into it, so the page shows no other one.

import type { Clip } from "../types.ts";

/** For a person who does not see it. It has other places only if the clip has some on the level of the first one. */
export function overlayInWords({ alignment }: Pick<Clip, "alignment">): string {
  const [best, ...others] = alignment?.alternatives ?? [];
  const hasOthers = others.some(({ level }) => level === best?.level);
  return "The clip over the LiDAR map, at the service's own answer: green where a wall of the map is, and red where none is. The camera's path is blue"
    + `${hasOthers ? ", other places of the clip are orange" : ""}.`;
}
