// The name of a home, and the buttons that rename it, delete its shown level, and delete it.

import * as api from "../api.ts";
import { h } from "../dom.ts";
import { askText, confirm } from "../parts/dialog.ts";
import { attempt, say } from "../parts/notices.ts";
import { levelWord, many, named } from "../words.ts";
import type { HomeData } from "./data.ts";

const MOST_LETTERS = 200;

interface Listener {
  onRenamed: () => void;
  onLevelDeleted: () => void;
  onDeleted: () => void;
}

export class Settings {
  readonly heading = h("h1", { dir: "auto" });
  readonly element: HTMLElement;
  private readonly level = button("Delete level", "danger quiet", () => this.deleteLevel());

  constructor(
    private readonly data: HomeData,
    private readonly listener: Listener,
  ) {
    this.element = h("p", { class: "row end" },
      button("Rename home", "quiet", () => this.rename()), this.level,
      button("Delete home", "danger quiet", () => this.deleteHome()));
    this.draw();
  }

  draw(): void {
    this.heading.textContent = this.data.name;
    this.level.hidden = !this.data.hasLevels;
  }

  private async rename(): Promise<void> {
    const { home } = this.data;
    const name = await askText("Name of the home", home.name ?? "", "Rename", MOST_LETTERS);
    if (name === null) return;
    await api.renameHome(home.id, name || null);
    say("The home is renamed.");
    this.listener.onRenamed();
  }

  private async deleteLevel(): Promise<void> {
    const { home, level } = this.data;
    const text = "Its LiDAR maps, and the choices and corrections on it, are removed for good. All clips are placed again on the " +
      "other levels.";
    if (!(await confirm(`Delete the level “${levelWord(level)}”?`, text, "Delete level"))) return;
    await this.data.deleting(level, () => api.deleteLevel(home.id, level));
    say(`The level “${levelWord(level)}” is deleted.`);
    this.listener.onLevelDeleted();
  }

  private async deleteHome(): Promise<void> {
    const { home, name, clips } = this.data;
    const text = `The LiDAR maps, ${many(clips.length, "clip")} and everything made of them are removed for good.`;
    if (!(await confirm(`Delete ${named(name)}?`, text, "Delete home"))) return;
    await api.deleteHome(home.id);
    say(`${named(name)} is deleted.`);
    this.listener.onDeleted();
  }
}

function button(word: string, kind: string, act: () => Promise<void>): HTMLButtonElement {
  const button = h("button", { type: "button", class: kind }, word);
  button.addEventListener("click", () => void attempt(button, act));
  return button;
}
