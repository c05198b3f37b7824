// Colours of points: by what was filmed, class, clip or probability.

export const COLOURINGS = ["colour", "class", "clip", "probability"] as const;
export type Colouring = (typeof COLOURINGS)[number];

export const COLOURING_WORDS: Record<Colouring, string> = {
  colour: "Colour",
  class: "Class",
  clip: "Clip",
  probability: "Probability",
};

/** The reason why points cannot be shown in colour. */
export const NO_COLOUR = "No clip here was filmed with colour";

export type Rgb = [number, number, number];

/** `#rrggbb` as three numbers up to 255; grey for anything else. */
export function rgb(color: string): Rgb {
  const match = /^#([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$/i.exec(color);
  if (!match) return [154, 154, 154];
  return [1, 2, 3].map((group) => parseInt(match[group] ?? "0", 16)) as Rgb;
}

export function css([red, green, blue]: Rgb): string {
  return `rgb(${red} ${green} ${blue})`;
}

/** A colour for the n-th clip: hues a golden angle apart are never close to those of their neighbours. */
export function clipColour(index: number): Rgb {
  const hue = (212 + index * 137.508) % 360;
  const lightness = [0.58, 0.68, 0.5][Math.floor(index / 8) % 3] ?? 0.58;
  return fromHsl(hue, 0.62, lightness);
}

function fromHsl(hue: number, saturation: number, lightness: number): Rgb {
  const reach = saturation * Math.min(lightness, 1 - lightness);
  const channel = (offset: number) => {
    const k = (offset + hue / 30) % 12;
    return Math.round(255 * (lightness - reach * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
  };
  return [channel(0), channel(8), channel(4)];
}

/** From unlikely to certain; even in brightness, and told apart by the colour-blind. */
export const RAMP: Rgb[] = [
  [122, 4, 84],
  [206, 62, 77],
  [245, 142, 75],
  [205, 205, 120],
  [74, 190, 160],
];
