// Keeps the page in step with the session of this browser: it may end, and other tabs begin and end it too.

import { alarm } from "../parts/notices.ts";
import { isSessionEnd, onOtherTab, onSessionEnd, readSession, tellTabs } from "../session.ts";
import type { Session } from "../types.ts";

export class SessionFollower {
  /** The session that the page was shown with; null while the form to sign in is shown. */
  private shown: Session | null = null;
  private isChecking = false;

  /** `show` shows the page again, or the form to sign in. */
  constructor(private readonly show: () => void) {
    onSessionEnd((message) => void this.check(message));
    onOtherTab(() => void this.check());
  }

  /** Tells that the page is shown with a session. */
  began(session: Session): void {
    this.shown = session;
  }

  /** Tells that nobody is signed in; returns true if somebody was. */
  ended(): boolean {
    const wasThere = this.shown !== null && this.shown.with_key;
    this.shown = null;
    if (wasThere) tellTabs();
    return wasThere;
  }

  /** Shows the page again if the session is another one than that of the page; otherwise tells the message of a refusal. */
  async check(message = ""): Promise<void> {
    if (this.isChecking) return;
    this.isChecking = true;
    try {
      const now = await readSession(new AbortController().signal);
      if (now.tenant !== this.shown?.tenant || now.role !== this.shown.role) this.show();
      else if (message) alarm(message);
    } catch (error) {
      // The form to sign in stays as it is: a person may be typing a key.
      if (isSessionEnd(error) && this.shown) this.show();
      else if (message) alarm(message);
    } finally {
      this.isChecking = false;
    }
  }
}
