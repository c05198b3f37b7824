// Answers XMLHttpRequests in a test.

export interface Answer {
  /** 0 for a connection that breaks. */
  status: number;
  headers?: Record<string, string>;
  body?: string;
}

export interface Asked {
  method: string;
  path: string;
  headers: Map<string, string>;
  /** Length of the body. */
  bytes: number;
}

/** Replaces XMLHttpRequest. An answer of null never comes. */
export function answerRequests(answer: (asked: Asked) => Answer | null): void {
  class FakeRequest extends EventTarget {
    readonly upload = new EventTarget();
    status = 0;
    responseText = "";
    private method = "";
    private path = "";
    private readonly headers = new Map<string, string>();
    private answered: Record<string, string> = {};

    open(method: string, path: string): void {
      [this.method, this.path] = [method, path];
    }

    setRequestHeader(name: string, value: string): void {
      this.headers.set(name, value);
    }

    getResponseHeader(name: string): string | null {
      return this.answered[name] ?? null;
    }

    abort(): void {
      this.dispatchEvent(new Event("abort"));
      this.dispatchEvent(new Event("loadend"));
    }

    send(body: Blob | null): void {
      const { method, path, headers } = this;
      const given = answer({ method, path, headers, bytes: body?.size ?? 0 });
      queueMicrotask(() => {
        this.upload.dispatchEvent(new Event("loadend"));
        if (!given) return;
        [this.status, this.answered, this.responseText] = [given.status, given.headers ?? {}, given.body ?? ""];
        this.dispatchEvent(new Event(given.status === 0 ? "error" : "load"));
        this.dispatchEvent(new Event("loadend"));
      });
    }
  }
  globalThis.XMLHttpRequest = FakeRequest as unknown as typeof XMLHttpRequest;
}
