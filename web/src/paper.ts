// The service draws the LiDAR map dark on white paper. Here the paper is removed, so the picture lies on
// any ground, and in the dark its inks are turned light.

import { picture as read } from "./api.ts";

/** Takes white away from every pixel: what remains is ink with as much opacity as it has darkness. */
export function takePaper(pixels: Uint8ClampedArray, isDark: boolean): void {
  for (let i = 0; i < pixels.length; i += 4) {
    const [red, green, blue] = [pixels[i] ?? 255, pixels[i + 1] ?? 255, pixels[i + 2] ?? 255];
    const opacity = 255 - Math.min(red, green, blue);
    if (opacity === 0) {
      pixels[i + 3] = 0;
      continue;
    }
    // The ink's own colour, without the white below it.
    const pure = (value: number) => 255 - ((255 - value) * 255) / opacity;
    const ink = [pure(red), pure(green), pure(blue)] as const;
    // Turning the lightness over keeps the hue: the sum of the brightest and the darkest channel is mirrored.
    const shift = isDark ? 255 - (Math.max(...ink) + Math.min(...ink)) : 0;
    pixels[i] = ink[0] + shift;
    pixels[i + 1] = ink[1] + shift;
    pixels[i + 2] = ink[2] + shift;
    pixels[i + 3] = isDark ? Math.min(255, opacity * 1.1) : opacity;
  }
}

/** A picture without its paper. */
export async function inkOf(path: string, isDark: boolean, signal: AbortSignal): Promise<HTMLCanvasElement> {
  const picture = await createImageBitmap(await read(path, signal));
  const canvas = document.createElement("canvas");
  canvas.width = picture.width;
  canvas.height = picture.height;
  const context = canvas.getContext("2d");
  if (!context) throw new Error("This browser does not support canvases.");
  context.drawImage(picture, 0, 0);
  picture.close();
  const image = context.getImageData(0, 0, canvas.width, canvas.height);
  takePaper(image.data, isDark);
  context.putImageData(image, 0, 0);
  return canvas;
}

/** An address of the canvas's picture; revoke it when it is no longer shown. */
export function addressOf(canvas: HTMLCanvasElement): Promise<string> {
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => {
      if (blob) resolve(URL.createObjectURL(blob));
      else reject(new Error("The picture is empty."));
    });
  });
}
