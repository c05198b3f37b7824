// A small picture of a clip, or its place in a list while there is none.

import { clipPath } from "../api.ts";
import { answerName } from "../clip/last.ts";
import { h } from "../dom.ts";
import type { Clip } from "../types.ts";

/** The picture comes with the clip's answer, and stays while the clip is aligned again; a clip without colour has none. */
export function thumbnail(clip: Clip, name: string): HTMLElement {
  const frame = h("span", { class: "clip-picture" });
  if (!clip.alignment && !clip.last_answer) return frame;
  const picture = h("img", {
    // Another job may have taken another frame.
    src: `${clipPath(clip, "thumbnail.jpg")}?job=${answerName(clip)}`,
    alt: `A frame of ${name}`, loading: "lazy", decoding: "async",
  });
  picture.addEventListener("error", () => picture.remove());
  frame.append(picture);
  return frame;
}
