// A small document for the tests of parts that make elements. Import it first: some modules make elements at once.

class FakeElement extends EventTarget {
  children: (FakeElement | string)[] = [];
  parent: FakeElement | null = null;
  className = "";
  hidden = false;
  disabled = false;
  value: unknown = "";
  readonly dataset: Record<string, string> = {};
  readonly style: Record<string, unknown> = { setProperty: () => {} };
  readonly classList = { add: () => {}, remove: () => {}, toggle: () => {} };
  private readonly attributes = new Map<string, string>();

  constructor(readonly tag: string) {
    super();
  }

  setAttribute(name: string, value: string): void {
    this.attributes.set(name, value);
    if (name === "value") this.value = value;
    if (name === "class") this.className = value;
    if (name === "hidden") this.hidden = true;
    if (name.startsWith("data-")) this.dataset[name.slice("data-".length)] = value;
  }

  getAttribute(name: string): string | null {
    return this.attributes.get(name) ?? null;
  }

  removeAttribute(name: string): void {
    this.attributes.delete(name);
  }

  append(...children: (FakeElement | string)[]): void {
    for (const child of children) {
      if (typeof child !== "string") child.parent = this;
      this.children.push(child);
    }
    // As a browser does, a list of options chooses its first one.
    const [first] = this.children;
    if (this.tag === "select" && first instanceof FakeElement) this.value = String(first.value);
  }

  replaceChildren(...children: (FakeElement | string)[]): void {
    for (const child of this.children) if (child instanceof FakeElement) child.parent = null;
    this.children = [];
    this.append(...children);
  }

  remove(): void {
    const { parent } = this;
    if (parent) parent.children = parent.children.filter((child) => child !== this);
    this.parent = null;
  }

  closest(): null {
    return null;
  }

  /** Knows the keys of elements only; the tests look at elements by their tags. */
  querySelector(selector: string): FakeElement | null {
    const [, key] = /\[data-key="(.+)"\]$/.exec(selector) ?? [];
    return key === undefined ? null : (this.below().find(({ dataset }) => dataset.key === key) ?? null);
  }

  querySelectorAll(): FakeElement[] {
    return [];
  }

  checkVisibility(): boolean {
    return this.isConnected && !this.hidden;
  }

  focus(): void {
    if (this.checkVisibility()) focused = this;
  }

  getBoundingClientRect(): Record<string, number> {
    return { x: 0, y: 0, top: 0, bottom: 0, width: 0, height: 0 };
  }

  /** Texts are as wide as without a canvas. */
  getContext(): null {
    return null;
  }

  showModal(): void {}

  contains(other: unknown): boolean {
    return other === this || this.below().some((child) => child === other);
  }

  get isConnected(): boolean {
    return this === body || (this.parent?.isConnected ?? false);
  }

  get textContent(): string {
    return this.children.map((child) => (typeof child === "string" ? child : child.textContent)).join("");
  }

  set textContent(text: string) {
    this.children = text ? [text] : [];
  }

  private below(): FakeElement[] {
    return this.children.filter((child) => child instanceof FakeElement).flatMap((child) => [child, ...child.below()]);
  }

  /** All elements of a tag below this one. */
  all(tag: string): FakeElement[] {
    return this.below().filter((child) => child.tag === tag);
  }
}

export type { FakeElement };

export const body = new FakeElement("body");
let focused = body;
const events = new EventTarget();

/** What the browser keeps. */
export const kept = new Map<string, string>();

Object.assign(globalThis, {
  document: Object.defineProperty(Object.assign(new EventTarget(), {
    body, hidden: false, title: "",
    createElement: (tag: string) => new FakeElement(tag),
    createElementNS: (_: string, tag: string) => new FakeElement(tag),
    querySelector: (selector: string) => body.querySelector(selector),
  }), "activeElement", { get: () => (focused.isConnected ? focused : body) }),
  window: globalThis,
  CSS: { escape: (text: string) => text },
  HTMLElement: FakeElement,
  addEventListener: events.addEventListener.bind(events),
  removeEventListener: events.removeEventListener.bind(events),
  dispatchEvent: events.dispatchEvent.bind(events),
  localStorage: {
    getItem: (name: string) => kept.get(name) ?? null,
    setItem: (name: string, value: string) => void kept.set(name, value),
    removeItem: (name: string) => void kept.delete(name),
  },
});
// Node.js has one since version 21.
if (!("navigator" in globalThis)) Object.assign(globalThis, { navigator: { onLine: true } });

/** An element as the fake that it is. */
export function fake(element: HTMLElement): FakeElement {
  return element as unknown as FakeElement;
}

/** Waits until a condition holds; the time of the test is that of the machine. */
export async function until(holds: () => boolean): Promise<void> {
  for (let tries = 0; !holds(); tries++) {
    if (tries > 1000) throw new Error(`it does not hold: ${holds}`);
    await new Promise((resolve) => setTimeout(resolve, 1));
  }
}
