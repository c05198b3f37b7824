"use strict";
// Lists homes and their clips and keeps the list fresh. All text goes in as text, never as markup.

const BUSY_MS = 1500;
const IDLE_MS = 8000;
const HOMES = 50; // on one page
const shown = new Map(); // element id -> { text, element }: what has not changed is not drawn again

async function get(path) {
  const answer = await fetch(path);
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.detail || answer.statusText);
  return body;
}

async function all(path) {
  const items = [];
  let after = "";
  do {
    const page = await get(`${path}?limit=200${after}`);
    items.push(...page.items);
    after = page.next ? `&after=${encodeURIComponent(page.next)}` : null;
  } while (after);
  return items;
}

function keep(key, value, draw) {
  const text = JSON.stringify(value);
  const old = shown.get(key);
  if (old && old.text === text) return old.element;
  const element = draw(value, old && old.element);
  shown.set(key, { text, element });
  return element;
}

function fresh(template) {
  return document.getElementById(template).content.firstElementChild.cloneNode(true);
}

function time(text) {
  return new Date(text).toLocaleString();
}

function drawClip(clip) {
  const card = fresh("clip");
  const find = (selector) => card.querySelector(selector);
  const path = `/v1/homes/${clip.home}/clips/${clip.id}`;
  card.classList.add(clip.state);
  find(".state").textContent = clip.state;
  const { alignment, job, info } = clip;
  const pose = alignment && alignment.map_from_clip;
  if (pose) {
    const degrees = (pose.yaw_rad * 180) / Math.PI;
    find(".pose").textContent = `at x ${pose.x_m.toFixed(2)} m, y ${pose.y_m.toFixed(2)} m, ${degrees.toFixed(1)}°`;
  }
  const bar = find("progress");
  bar.hidden = clip.state !== "aligning";
  if (job && !bar.hidden) {
    bar.value = job.progress;
    find(".pose").textContent = job.stage || "";
  }
  for (const reason of clip.reasons) {
    const code = Object.assign(document.createElement("code"), { textContent: reason.code });
    const item = document.createElement("li");
    item.append(code, ` ${reason.detail}`);
    find(".reasons").append(item);
  }
  const picture = find(".picture");
  picture.hidden = !alignment;
  if (alignment) {
    picture.href = `${path}/overlay.png`;
    picture.firstElementChild.src = `${path}/overlay.png?job=${job ? job.id : ""}`;
  }
  const tries = job && job.attempts > 1 ? `, attempt ${job.attempts} of ${job.max_attempts}` : "";
  find(".facts").textContent =
    `${clip.id} · ${info.layout}, ${info.frames} frames, ${(clip.size_bytes / 1e6).toFixed(1)} MB · ${time(clip.created_at)}${tries}`;
  return card;
}

function drawHome({ home, states }, old) {
  const section = old || fresh("home");
  const find = (selector) => section.querySelector(selector);
  find("h2").textContent = home.name ? `${home.name} (${home.id})` : home.id;
  find(".facts").textContent =
    Object.entries(states).map(([state, count]) => `${count} ${state}`).join(", ") || "no clips";
  const revision = home.lidar_map_revision;
  find("figcaption").textContent = revision ? `LiDAR map, revision ${revision}` : "no LiDAR map yet";
  const link = find(".map a");
  link.hidden = !revision;
  if (revision) {
    link.href = `/v1/homes/${home.id}/lidar-map/image.png`;
    const source = `${link.href}?revision=${revision}`;
    if (link.firstElementChild.src !== source) link.firstElementChild.src = source;
  }
  return section;
}

async function refresh() {
  const after = new URLSearchParams(location.search).get("after");
  const page = await get(`/v1/homes?limit=${HOMES}${after ? `&after=${encodeURIComponent(after)}` : ""}`);
  const homes = page.items;
  const sections = [];
  const counts = {};
  for (const home of homes) {
    const clips = await all(`/v1/homes/${home.id}/clips`);
    const states = {};
    for (const clip of clips) {
      states[clip.state] = (states[clip.state] || 0) + 1;
      counts[clip.state] = (counts[clip.state] || 0) + 1;
    }
    const section = keep(`home ${home.id}`, { home, states }, drawHome);
    const cards = clips.reverse().map((clip) => keep(`clip ${clip.id}`, clip, drawClip));
    section.querySelector(".clips").replaceChildren(...cards);
    sections.push(section);
  }
  document.getElementById("homes").replaceChildren(...sections);
  const summary = Object.entries(counts).map(([state, count]) => `${count} ${state}`).join(", ");
  document.getElementById("status").textContent = homes.length
    ? `${homes.length} ${homes.length === 1 ? "home" : "homes"}; clips: ${summary || "none"}`
    : "No home yet: PUT /v1/homes/{home} makes one.";
  const more = document.getElementById("more");
  more.hidden = !page.next;
  more.href = page.next ? `/?after=${encodeURIComponent(page.next)}` : "";
  return Boolean(counts.queued || counts.aligning);
}

async function run() {
  let busy = false;
  try {
    busy = await refresh();
  } catch (error) {
    document.getElementById("status").textContent = `The service does not answer: ${error.message}`;
  }
  setTimeout(run, busy ? BUSY_MS : IDLE_MS);
}

run();
