// Makes elements. Text always goes in as text, never as markup, so that no name or reason can run.

export type Child = Node | string | number | null | undefined | false;
type Value = string | number | boolean | null | undefined | ((event: never) => void);
type Attributes = Record<string, Value>;

function fill(element: Element, attributes: Attributes, children: readonly Child[]): void {
  for (const [name, value] of Object.entries(attributes)) set(element, name, value);
  element.append(...children.filter(isShown).map((child) => (typeof child === "number" ? String(child) : child)));
}

function isShown(child: Child): child is Node | string | number {
  return child !== null && child !== undefined && child !== false;
}

/** Sets an attribute; `on...` adds a listener, `true` an empty attribute, and `false` or null removes it. */
function set(element: Element, name: string, value: Value): void {
  if (typeof value === "function") {
    element.addEventListener(name.slice(2), value as EventListener);
  } else if (value === false || value === null || value === undefined) {
    element.removeAttribute(name);
  } else {
    element.setAttribute(name, value === true ? "" : String(value));
  }
}

/** An HTML element. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  fill(element, attributes, children);
  return element;
}

/** An SVG element. */
export function s<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  fill(element, attributes, children);
  return element;
}

/** True if a click on a button came from a key: it has no number of clicks. */
export function isByKey(click: MouseEvent): boolean {
  return click.detail === 0;
}

/** Replaces the content of an element. The focus stays as `keepFocus` says. */
export function putAgain(element: Element, ...children: Child[]): void {
  keepFocus(element, () => put(element, ...children));
}

/**
 * Runs a change of an element's content, and gives the focus back to the element of the same `data-key`. If that one is gone, as
 * the row of a deleted clip, the heading of the section has it: otherwise a person with keys would begin at the top of the page.
 */
export function keepFocus(element: Element, change: () => void): void {
  const focused = document.activeElement;
  const key = focused instanceof HTMLElement && element.contains(focused) ? focused.dataset.key : undefined;
  change();
  if (!key || element.contains(document.activeElement)) return;
  const same = element.querySelector<HTMLElement>(`[data-key="${CSS.escape(key)}"]`);
  (same ?? element.closest("details.section")?.querySelector<HTMLElement>("summary"))?.focus({ preventScroll: true });
}

/** Replaces what an element holds. */
export function put(element: Element, ...children: Child[]): void {
  element.replaceChildren();
  fill(element, {}, children);
}
