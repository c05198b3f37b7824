// Checks messages with the library of Standard Webhooks: one line of JSON on standard input for each message, with its
// headers and body, and the secret. `tests/api/webhooks.rs` starts it.
import { createInterface } from "node:readline";
import { Webhook } from "standardwebhooks";

for await (const line of createInterface({ input: process.stdin })) {
  const { secret, headers, body } = JSON.parse(line);
  const message = new Webhook(secret).verify(body, headers);
  console.log(message.type);
}
