// Bundles the viewer into a folder: index.html, and assets whose names carry a hash of their content.
// build.rs calls it with the folder; nothing is written anywhere else.
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { basename, dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2];
if (!out) throw new Error("usage: node build.mjs FOLDER");

const common = {
  absWorkingDir: here,
  bundle: true,
  minify: true,
  format: "esm",
  target: ["es2022", "safari17"],
  entryNames: "[name]-[hash]",
  outdir: join(out, "assets"),
  metafile: true,
  logLevel: "warning",
};

/** The name of the output of an entry point that ends in `.js` or `.css`. */
function named(result, ending) {
  const names = Object.keys(result.metafile.outputs).map((path) => basename(path));
  const name = names.find((name) => name.endsWith(ending));
  if (!name) throw new Error(`the bundle has no ${ending}`);
  return name;
}

await mkdir(join(out, "assets"), { recursive: true });
const worker = await build({ ...common, entryPoints: { points: "src/cloud/worker.ts" } });
const page = await build({
  ...common,
  entryPoints: { viewer: "src/main.ts" },
  define: { POINTS_WORKER: JSON.stringify(`/assets/${named(worker, ".js")}`) },
});
const template = await readFile(join(here, "src/index.html"), "utf8");
const html = template
  .replace("SCRIPT", () => `/assets/${named(page, ".js")}`)
  .replace("STYLE", () => `/assets/${named(page, ".css")}`);
await writeFile(join(out, "index.html"), html);
