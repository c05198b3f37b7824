// The session of this browser: the rights of its key, and whether the browser can keep it.

import { session } from "./api.ts";
import type { Session } from "./types.ts";

let role: Session["role"] = "admin";

/** Reads the session again: another page of this browser may have signed in with another key. */
export async function readSession(signal: AbortSignal): Promise<Session> {
  const read = await session(signal);
  ({ role } = read);
  return read;
}

/** True if the key may change something; the pages offer their controls by it. */
export function mayChange(): boolean {
  return role === "admin";
}

/** True for names of this machine. The service demands TLS for its cookie everywhere else. */
export function isLoopback(hostname: string): boolean {
  return /^(localhost|.+\.localhost|127(\.\d+){3}|\[::1\])$/.test(hostname);
}
