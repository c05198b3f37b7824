// The page for a key that only sends clips: the service shows it no map and no list.

import { h, put } from "../dom.ts";
import { type Place, setCrumbs } from "./page.ts";

export function showUploader(place: Place): void {
  setCrumbs(place, [], "Uploads only");
  put(place.main, h("section", { class: "empty" },
    h("h1", {}, "This key only uploads"),
    h("p", {}, "A key of the role ", h("code", {}, "uploader"), " sends clips and follows their jobs. The viewer needs a key of the role ",
      h("code", {}, "reader"), " or ", h("code", {}, "admin"), ". Sign out to enter another key.")));
}
