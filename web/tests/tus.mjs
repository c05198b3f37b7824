// Uploads one file in every way that a public tus client knows, over connections that break. `tests/api/tus_client.rs`
// starts it with the server's address, a home and the file, and reads a line of JSON for each clip that was made.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { connect, createServer } from "node:net";
import { Readable } from "node:stream";
import { Upload } from "tus-js-client";

const { VIOLA_BASE: base, VIOLA_HOME: home, VIOLA_FILE: path } = process.env;
const bytes = await readFile(path);
const metadata = { home, filename: "clip.zip" };

/** The clip's path, or the client's error. */
function run(source, options, started = () => {}) {
  return new Promise((resolve, reject) => {
    const upload = new Upload(source, {
      endpoint: `${base}/v1/uploads`,
      metadata,
      retryDelays: null,
      onError: reject,
      onSuccess: ({ lastResponse }) => resolve(lastResponse.getHeader("Viola-Clip")),
      ...options,
    });
    started(upload);
    upload.start();
  });
}

/** Stops after the first acknowledged chunk; the upload's URL. */
function interrupted() {
  return new Promise((resolve, reject) => {
    const upload = new Upload(bytes, {
      endpoint: `${base}/v1/uploads`,
      metadata,
      chunkSize: 1000,
      onError: reject,
      onChunkComplete: () => upload.abort().then(() => resolve(upload.url), reject),
    });
    upload.start();
  });
}

/** A way to the server on which each of the first connections breaks after some more bytes than the one before. */
async function badNetwork(connections) {
  const { hostname, port } = new URL(base);
  let left = connections;
  const server = createServer((client) => {
    const remote = connect(Number(port), hostname);
    let allowed = left > 0 ? 1500 + 700 * (connections - left--) : Infinity;
    const cut = () => (client.destroy(), remote.destroy());
    client.on("data", (data) => {
      remote.write(data.subarray(0, Math.min(data.length, allowed)));
      allowed -= data.length;
      if (allowed <= 0) cut();
    });
    remote.on("data", (data) => client.write(data));
    for (const socket of [client, remote]) socket.on("error", cut).on("close", cut);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { endpoint: `http://127.0.0.1:${server.address().port}/v1/uploads`, end: () => server.close(), cuts: () => connections - left };
}

const say = (way, clip) => console.log(JSON.stringify({ way, clip }));

say("whole", await run(bytes, {}));
say("chunks", await run(bytes, { chunkSize: 1000 }));
say("with creation", await run(bytes, { uploadDataDuringCreation: true }));
say("chunks from creation on", await run(bytes, { uploadDataDuringCreation: true, chunkSize: 1500 }));
say("length told last", await run(Readable.from([bytes]), { uploadLengthDeferred: true, chunkSize: 1200 }));
say("in parallel", await run(bytes, { parallelUploads: 3 }));
say("only POST", await run(bytes, { overridePatchMethod: true, chunkSize: 2000 }));

const url = await interrupted();
say("resumed", await run(bytes, { uploadUrl: url }));

const network = await badNetwork(8);
const patient = { endpoint: network.endpoint, retryDelays: Array.from({ length: 12 }, () => 10) };
say("over a bad network", await run(bytes, patient));
assert.equal(network.cuts(), 8);
network.end();

// A file that is no clip is refused with its last byte, and not sent again.
const refused = await run(Buffer.from("x".repeat(5000)), { chunkSize: 3000, retryDelays: [0, 0] }).then(
  () => assert.fail("it is no clip"),
  (error) => error.originalResponse,
);
assert.equal(refused.getStatus(), 415);
assert.equal(JSON.parse(refused.getBody()).type, "urn:viola:problem:unknown-layout");

// Given up: the server forgets it.
const given = await interrupted();
await Upload.terminate(given, {});
const answer = await fetch(given, { method: "HEAD", headers: { "Tus-Resumable": "1.0.0" } });
assert.equal(answer.status, 404);
