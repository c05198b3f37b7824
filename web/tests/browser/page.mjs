// Actions of a person on the page, and the delays that a person would feel.

/** Drops files in the middle of the page. */
export async function dropFiles(page, files) {
  const encoded = files.map(({ name, bytes }) => ({ name, base64: bytes.toString("base64") }));
  await page.evaluate((files) => {
    const data = new DataTransfer();
    for (const { name, base64 } of files) {
      data.items.add(new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], name));
    }
    const target = document.querySelector("main");
    for (const type of ["dragenter", "dragover", "drop"]) {
      target.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true, cancelable: true }));
    }
  }, encoded);
}

/** Chooses a file in a field; the file is the same after a reload of the page. */
export async function chooseFile(page, field, { name, bytes }) {
  await page.evaluate(({ field, name, base64 }) => {
    const data = new DataTransfer();
    const file = new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], name, { lastModified: 5 });
    data.items.add(file);
    const input = document.querySelector(field);
    input.files = data.files;
    input.dispatchEvent(new Event("change"));
  }, { field, name, base64: bytes.toString("base64") });
}

/** Writes down which bars of progress and which stages are shown from now on. */
export async function recordProgress(page) {
  await page.evaluate(() => {
    const seen = { uploads: [], stages: [] };
    globalThis.progressSeen = seen;
    const note = (list, text) => text && !list.includes(text) && list.push(text);
    new MutationObserver(() => {
      const bars = document.querySelectorAll(".uploads progress");
      for (const bar of bars) note(seen.uploads, bar.getAttribute("aria-label"));
      for (const stage of document.querySelectorAll(".clip .progress .hint")) note(seen.stages, stage.textContent);
    }).observe(document.body, { childList: true, subtree: true, characterData: true });
  });
}

/**
 * Returns the waits of inputs from the device to the end of their handlers, in milliseconds, and the frames that were shown
 * meanwhile. The time stamp of an event is when the browser got it.
 */
export async function measureInput(page, act) {
  await page.evaluate(() => {
    const seen = { inputs: 0, slowest_ms: 0, slowest: "", frames: 0, longest_frame_ms: 0, begun: performance.now() };
    globalThis.inputSeen = seen;
    const note = (event) => {
      // A message to oneself comes after every handler of the event.
      const channel = new MessageChannel();
      channel.port1.onmessage = () => {
        const waited = performance.now() - event.timeStamp;
        seen.inputs += 1;
        if (waited > seen.slowest_ms) [seen.slowest_ms, seen.slowest] = [Math.round(waited), event.type];
      };
      channel.port2.postMessage(null);
    };
    for (const type of ["pointerdown", "pointermove", "pointerup", "click", "change", "keydown"]) {
      addEventListener(type, note, { capture: true });
    }
    let last = performance.now();
    const frame = () => {
      const now = performance.now();
      seen.longest_frame_ms = Math.max(seen.longest_frame_ms, Math.round(now - last));
      seen.frames += 1;
      last = now;
      if (globalThis.inputSeen) requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  });
  await act();
  return page.evaluate(async () => {
    for (let frame = 0; frame < 2; frame++) await new Promise(requestAnimationFrame);
    const { begun, ...seen } = globalThis.inputSeen;
    globalThis.inputSeen = null;
    return { ...seen, frames_per_s: Number(((1000 * seen.frames) / (performance.now() - begun)).toFixed(1)) };
  });
}

export async function boxOf(locator) {
  const box = await locator.boundingBox();
  if (!box) throw new Error("what should be seen is not there");
  return box;
}

/**
 * Checks that input waits at most `limit_ms` longer for what is drawn of the fused map than it waits without it, measured
 * beside each other: other processes share the machine. `isShown` waits until the map is drawn.
 */
export async function isResponsive(page, { act, isShown, limit_ms, say }) {
  const fused = page.locator("input[data-name=points]");
  // Another process may take the machine for a moment; what the page itself does, it does every time.
  for (let left = 3; left > 0; left--) {
    await fused.uncheck();
    const without = await measureInput(page, act);
    await fused.check();
    await isShown();
    const measured = await measureInput(page, act);
    say(`${JSON.stringify(measured)}; without the map ${without.slowest_ms} ms`);
    if (measured.inputs <= 20) throw new Error(`only ${measured.inputs} inputs were measured`);
    if (measured.slowest_ms < limit_ms + without.slowest_ms) return;
  }
  throw new Error(`an input waited ${limit_ms} ms longer than without the map, three times`);
}

/** Checks it for every colouring that has a legend, on the plan. */
export async function theLegendLiesBelowThePlan(page) {
  for (const colouring of ["probability", "class"]) {
    await page.locator(`#colouring-${colouring}`).check({ force: true });
    await page.locator(".legend").waitFor();
    await page.waitForFunction(() => {
      const [plan, legend] = [".views > .plan", ".legend"].map((name) => document.querySelector(name).getBoundingClientRect());
      return plan.height > 100 && plan.bottom <= legend.top;
    });
  }
}

/** Checks that the tools and the legend leave a small phone a plan to look at. */
export async function aSmallPhoneHasAPlan(page) {
  const { width, height } = page.viewportSize();
  for (const size of [{ width: 320, height: 568 }, { width: 844, height: 390 }]) {
    await page.setViewportSize(size);
    await page.waitForFunction(() => document.querySelector(".views > .plan").getBoundingClientRect().height > 110);
  }
  await page.setViewportSize({ width, height });
}

/** Checks that a view that nobody moved shows the whole home again after the window has got another shape. */
export async function aTurnedPhoneShowsTheHomeWhole(page) {
  const isDrawn = () => page.locator(".stage-3d[data-done='1']").waitFor({ state: "attached" });
  const names = () => page.locator(".name.room:visible").evaluateAll((all) => all.map((name) => {
    const { x, y } = name.getBoundingClientRect();
    return [name.textContent, Math.round(x), Math.round(y)].join(" ");
  }));
  const { width, height } = page.viewportSize();
  await page.getByRole("button", { name: "Fit" }).click();
  await isDrawn();
  const whole = await names();
  for (const size of [{ width: 1280, height: 800 }, { width, height }]) {
    await page.setViewportSize(size);
    await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
    await isDrawn();
  }
  const again = await names();
  if (whole.length === 0 || again.join() !== whole.join()) throw new Error(`the names are at ${again} instead of ${whole}`);
}
