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

/** What an operation refused, as an exception. */
export class Refused extends Error {
  constructor(readonly problem: Problem) {
    super(`${problem.title}: ${problem.detail}`);
  }
}

/** The data of an answer; a refusal is thrown. */
export function accepted<Data>(answer: { data?: Data; error?: Problem }): Data {
  if (answer.error !== undefined) throw new Refused(answer.error);
  return answer.data as Data;
}
