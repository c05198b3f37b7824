// Lays out labels so that none covers another.

export interface Label {
  /** The centre, in pixels or any other unit. */
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Shifts that are tried in this order, in heights of the label. */
const SHIFTS = [0, -1, 1];

/**
 * Returns each label's shift along y, or null if the label has no room. Earlier labels go before later ones; a label
 * that is already null stays out.
 */
export function arrange(labels: readonly (Label | null)[]): (number | null)[] {
  const taken: Label[] = [];
  return labels.map((label) => {
    if (!label) return null;
    for (const shift of SHIFTS) {
      const moved = { ...label, y: label.y + shift * label.height };
      if (taken.some((other) => overlap(other, moved))) continue;
      taken.push(moved);
      return shift * label.height;
    }
    return null;
  });
}

function overlap(a: Label, b: Label): boolean {
  return 2 * Math.abs(a.x - b.x) < a.width + b.width && 2 * Math.abs(a.y - b.y) < a.height + b.height;
}

/** Cuts a text that is wider than `most_px`. */
export function shortened(text: string, font: string, most_px: number): string {
  if (textWidth(text, font) <= most_px) return text;
  const letters = [...text];
  let [fits, tooMany] = [0, letters.length];
  while (tooMany - fits > 1) {
    const middle = (fits + tooMany) >> 1;
    if (textWidth(`${letters.slice(0, middle).join("")}…`, font) <= most_px) fits = middle;
    else tooMany = middle;
  }
  return `${letters.slice(0, fits).join("").trimEnd()}…`;
}

let context: CanvasRenderingContext2D | null = null;

/** The width of a text in pixels; `font` is a weight and a size, as `650 13px`. */
export function textWidth(text: string, font: string): number {
  context ??= document.createElement("canvas").getContext("2d");
  // About the mean width of a letter.
  if (!context) return text.length * 7;
  context.font = `${font} ${getComputedStyle(document.body).fontFamily}`;
  return context.measureText(text).width;
}
