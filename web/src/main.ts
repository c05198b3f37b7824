// The page: a bar that stays, and below it what the address names.

import { signOut } from "./api.ts";
import { h, put } from "./dom.ts";
import { showClip } from "./pages/clip.ts";
import { FailurePage } from "./pages/failure.ts";
import { SessionFollower } from "./pages/follow.ts";
import { showHome } from "./pages/home.ts";
import { showHomes } from "./pages/homes.ts";
import { showSignIn } from "./pages/signIn.ts";
import { showUploader } from "./pages/uploader.ts";
import { closeQuestions, confirm } from "./parts/dialog.ts";
import { attempt, clearNotices, noticeBoard } from "./parts/notices.ts";
import { parse, toHomes } from "./route.ts";
import { isSessionEnd, mayChange, readSession } from "./session.ts";
import { themeButton } from "./theme.ts";
import { refuseDrops } from "./upload/panel.ts";
import { resumeUploads, stopUploads, unsentFiles } from "./upload/queue.ts";
import { many } from "./words.ts";
import "./styles/main.css";

const crumbs = h("nav", { class: "crumbs", "aria-label": "Breadcrumb" });
const main = h("main", { id: "main", tabindex: -1 });

const leave = h("button", { type: "button", class: "quiet", hidden: true }, "Sign out");
leave.addEventListener("click", () => void attempt(leave, async () => {
  const unsent = unsentFiles();
  const text = `${many(unsent, "file")} that the service does not have yet will not be sent.`;
  if (unsent > 0 && !(await confirm("Sign out and stop the uploads?", text, "Sign out"))) return;
  await signOut();
  stopUploads();
  session.ended();
  await show();
}));

document.body.replaceChildren(
  h("a", { class: "skip", href: "#main", onclick: skip }, "Skip to content"),
  h("header", { class: "bar" },
    h("a", { class: "brand", href: toHomes() }, "viola"), crumbs,
    h("a", { class: "quiet button", href: "/docs/" }, "API"), leave, themeButton()),
  main, noticeBoard(),
);

let page = new AbortController();
let lastTenant: string | null = null;
const session = new SessionFollower(() => void show());
const failure = new FailurePage((isQuiet) => void showAgain(isQuiet));

/** Shows the page of the address; `isQuiet` leaves the page of a failure until another one is there. */
async function show(isQuiet = false): Promise<void> {
  page.abort();
  page = new AbortController();
  const { signal } = page;
  main.className = "";
  if (!isQuiet) {
    closeQuestions();
    clearNotices();
    failure.reset();
    put(main, h("p", { class: "loading", role: "status" }, "Loading …"));
  }
  const route = parse(location.hash);
  const place = { main, crumbs, signal, again: () => void show() };
  try {
    const now = await readSession(signal);
    const { role, tenant, with_key } = now;
    session.began(now);
    leave.hidden = !with_key;
    // Waiting files of one tenant are not sent with a key of another.
    if (lastTenant !== null && lastTenant !== tenant) stopUploads();
    lastTenant = tenant;
    if (mayChange()) resumeUploads();
    if (role === "uploader") showUploader(place);
    else if (route.page === "homes") await showHomes(place, route.asked);
    else if (route.page === "home") await showHome(place, route.home, route.view);
    else if (route.page === "clip") await showClip(place, route.home, route.clip);
    else throw new Error("There is nothing at this address.");
  } catch (error) {
    if (signal.aborted) return;
    if (isSessionEnd(error)) {
      leave.hidden = true;
      showSignIn(place, place.again, session.ended());
      return;
    }
    failure.show(place, error);
  }
}

/** Shows the page after a failure. The focus stays in the page, whose button may be gone. */
async function showAgain(isQuiet: boolean): Promise<void> {
  const hadFocus = main.contains(document.activeElement);
  await show(isQuiet);
  if (hadFocus && !main.contains(document.activeElement)) main.focus({ preventScroll: true });
}

/** The address belongs to the router, so the link moves the focus itself. */
function skip(event: Event): void {
  event.preventDefault();
  main.focus();
}

addEventListener("hashchange", () => {
  void show().then(() => {
    // The form to sign in focuses its field.
    if (!main.contains(document.activeElement)) main.focus({ preventScroll: true });
  });
});
refuseDrops();
void show();
