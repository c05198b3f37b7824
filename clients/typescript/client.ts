// The client: `openapi-fetch` with the types that `npm run generate` makes of the OpenAPI document.
import createClient, { type Client } from "openapi-fetch";
import type { components, paths } from "./schema.js";

export type Viola = Client<paths>;
export type Problem = components["schemas"]["Problem"];
export type Clip = components["schemas"]["Clip"];
export type Change = components["schemas"]["Change"];

/** `key` is one that `viola keys create` showed; none is needed on the service's own machine while there are no keys. */
export function viola(base: string, key?: string): Viola {
  return createClient<paths>({
    baseUrl: base,
    ...(key === undefined ? {} : { headers: { authorization: `Bearer ${key}` } }),
    // Files go as they are.
    bodySerializer: (body: unknown) => (body instanceof Blob ? body : JSON.stringify(body)),
  });
}

/** A refusal, as an exception. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    /** The service's explanation; none if a proxy answered in its place. */
    readonly problem: Problem | undefined,
    /** Seconds after which a retry may succeed (`Retry-After`), for 429 and 503. */
    readonly retryAfterS: number | undefined,
  ) {
    super(problem ? `${problem.title}: ${problem.detail}` : `The answer has the status ${status}.`);
  }
}

/** The data of an answer; a refusal is thrown. */
export function accepted<Data>(answer: { data?: Data; error?: unknown; response: Response }): Data {
  const { data, error, response } = answer;
  if (response.ok) return data as Data;
  const isProblem = typeof error === "object" && error !== null && "title" in error && "detail" in error;
  const seconds = Number(response.headers.get("retry-after") ?? Number.NaN);
  throw new Refused(
    response.status,
    isProblem ? (error as Problem) : undefined,
    Number.isFinite(seconds) ? seconds : undefined,
  );
}
