// Keeps the view in the address of the page, so that a person who comes back from a clip finds it again.

import { parse, toHome } from "../route.ts";

/** Browsers refuse an address that changes many times a second. */
const WRITE_MS = 250;

/** Scroll offsets of the side and of the page. */
interface Scrolled {
  side_px: number;
  page_px: number;
}

export class Address {
  private timer = 0;
  private isChanged = false;

  constructor(
    private readonly home: string,
    /** The view as the query of an address. */
    private readonly view: () => URLSearchParams,
    private readonly side: HTMLElement,
    private readonly signal: AbortSignal,
  ) {
    side.addEventListener("scroll", () => this.soon(), { signal });
    addEventListener("scroll", () => this.soon(), { signal });
    // A link leaves the page at once.
    document.addEventListener("click", () => this.replace(), { signal, capture: true });
    signal.addEventListener("abort", () => clearTimeout(this.timer));
  }

  /** Writes the view soon. */
  note(): void {
    this.isChanged = true;
    this.soon();
  }

  /** Writes the view. The history gets no new entry. */
  write(): void {
    this.isChanged = true;
    this.replace();
  }

  /** Scrolls as the entry of the history says. */
  scroll(): void {
    const { side_px, page_px } = (history.state ?? {}) as Partial<Scrolled>;
    if (side_px) this.side.scrollTop = side_px;
    if (page_px) scrollTo(0, page_px);
  }

  /** Writes the address soon; the view only if a person changed it. */
  soon(): void {
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.replace(), WRITE_MS);
  }

  private replace(): void {
    clearTimeout(this.timer);
    const route = parse(location.hash);
    // Another page's address may be there before this page has ended.
    if (this.signal.aborted || route.page !== "home" || route.home !== this.home) return;
    const scrolled: Scrolled = { side_px: this.side.scrollTop, page_px: scrollY };
    history.replaceState(scrolled, "", this.isChanged ? toHome(this.home, this.view()) : location.hash);
  }
}
