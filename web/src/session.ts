// The session of this browser: the rights of its key, its end, and whether the browser can keep it.

import { Refusal, session } from "./api.ts";
import type { Session } from "./types.ts";

let role: Session["role"] = "admin";
let tenant = "";

/** Reads the session again: another page of this browser may have signed in with another key. */
export async function readSession(signal: AbortSignal): Promise<Session> {
  const read = await session(signal);
  ({ role, tenant } = read);
  return read;
}

/** True if the key may change something; the pages offer their controls by it. */
export function mayChange(): boolean {
  return role === "admin";
}

/** The tenant of the session; empty before the first one. */
export function tenantNow(): string {
  return tenant;
}

/** True for names of this machine. The service demands TLS for its cookie everywhere else. */
export function isLoopback(hostname: string): boolean {
  return /^(localhost|.+\.localhost|127(\.\d+){3}|\[::1\])$/.test(hostname);
}

/** True if a request was refused because nobody is signed in. */
export function isSessionEnd(error: unknown): boolean {
  return error instanceof Refusal && error.status === 401;
}

const refused = new EventTarget();

/** Tells that a request was refused because nobody is signed in; `message` is the service's explanation. */
export function reportSessionEnd(message: string): void {
  refused.dispatchEvent(new CustomEvent("refused", { detail: message }));
}

/** Calls back after such a refusal. */
export function onSessionEnd(listen: (message: string) => void): void {
  refused.addEventListener("refused", (event) => listen((event as CustomEvent<string>).detail));
}

/** The tabs of a browser share its session cookie. */
const CHANNEL = "viola.session";
let channel: BroadcastChannel | null = null;

function tabs(): BroadcastChannel | null {
  if (typeof BroadcastChannel === "undefined") return null;
  channel ??= new BroadcastChannel(CHANNEL);
  return channel;
}

/** Tells the other tabs that a session began or ended. */
export function tellTabs(): void {
  tabs()?.postMessage("changed");
}

/** Calls back when another tab told so. */
export function onOtherTab(listen: () => void): void {
  tabs()?.addEventListener("message", listen);
}
