// Reads large answers, whose whole time nobody knows: only a pause without any byte is too long.

/** A connection that brings no byte for this time is lost. */
const STALLED_MS = 60_000;

/** The next piece of an answer, or its end; throws if neither comes in time. */
export async function nextPiece(pieces: ReadableStreamDefaultReader<Uint8Array>): Promise<ReadableStreamReadResult<Uint8Array>> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const stalled = new Promise<never>((_, reject) => {
    timer = setTimeout(() => reject(new Error("The connection brings no more bytes.")), STALLED_MS);
  });
  try {
    return await Promise.race([pieces.read(), stalled]);
  } catch (error) {
    pieces.cancel().catch(() => {});
    throw error;
  } finally {
    clearTimeout(timer);
  }
}

/** The bytes of an answer. */
export async function bytesOf(answer: Response): Promise<ArrayBuffer> {
  const pieces = answer.body?.getReader();
  const chunks: Uint8Array<ArrayBuffer>[] = [];
  for (;;) {
    const { value, done } = pieces ? await nextPiece(pieces) : { value: undefined, done: true };
    if (value) chunks.push(new Uint8Array(value));
    if (done) return new Blob(chunks).arrayBuffer();
  }
}
