// Pictures of a clip.

import { clipPath, picture } from "../api.ts";
import { answerName } from "../clip/last.ts";
import { h } from "../dom.ts";
import type { Clip } from "../types.ts";
import { patiently } from "../upload/retry.ts";

/**
 * A small picture of a clip, or its place in a list while there is none. It comes with the clip's answer, and stays while the clip is
 * aligned again; a clip without colour has none.
 */
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

/** Calls back if the service does not have a picture. A browser tells no reason, and never loads one again whose connection broke. */
export function whenMissing(image: HTMLImageElement, signal: AbortSignal, missing: () => void): void {
  image.addEventListener("error", () => {
    image.addEventListener("error", missing, { once: true });
    const address = image.getAttribute("src") ?? "";
    patiently(() => picture(address, signal), signal).then(() => image.setAttribute("src", address), () => signal.aborted || missing());
  }, { once: true });
}
