// The name of a file as the service takes it.

const MOST_CHARACTERS = 255;

/** The name without control characters; empty if nothing visible remains. */
export function sentName({ name }: { name: string }): string {
  const sent = [...name.replace(/\p{Cc}/gu, "")].slice(0, MOST_CHARACTERS).join("");
  return sent.trim() ? sent : "";
}
