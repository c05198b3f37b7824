// Tells what other tabs and other people removed: without a word, a row or the shown level would be gone from one moment to the next.

import { levelWord, many, named } from "../words.ts";
import type { HomeData } from "./data.ts";
import type { Looks } from "./looks.ts";
import { robotRoomOf, roomName, roomOf, type Selection, thingName, thingOf } from "./selection.ts";

/** More clips are counted, and not named. */
const MOST_NAMES = 3;
const ELSEWHERE = "deleted in another tab or by another person";

export class Losses {
  /** The names of the clips by their ids. */
  private clips = new Map<string, string>();
  private level = "";
  private selected: { selection: Selection; name: string } | null = null;

  constructor(
    private readonly data: HomeData,
    private readonly looks: Looks,
  ) {
    this.note();
    looks.onChange(() => this.noteSelected());
  }

  /** Returns what is gone since the call before, in sentences. */
  told(): string[] {
    const { data, looks, clips, level, selected } = this;
    const isThere = new Set(data.clips.map(({ id }) => id));
    const gone = [...clips].filter(([id]) => !isThere.has(id) && !data.deletedHere.has(id)).map(([, name]) => named(name));
    const told = gone.length > MOST_NAMES ? [`${many(gone.length, "clip")} were ${ELSEWHERE}.`] : gone.map((name) => `${name} was ${ELSEWHERE}.`);
    if (!data.levels.includes(level) && level !== data.level && !data.deletedHere.has(level)) {
      told.push(`The level “${levelWord(level)}” was ${ELSEWHERE}.`);
    } else if (selected && looks.selected === selected.selection && nameOf(data, looks.selected) === null) {
      told.push(`${named(selected.name)} is no longer in the map.`);
    }
    this.note();
    return told;
  }

  private note(): void {
    const { data } = this;
    this.clips = new Map(data.clips.map((clip) => [clip.id, data.nameOf(clip)]));
    this.level = data.level;
    this.noteSelected();
  }

  private noteSelected(): void {
    const { selected } = this.looks;
    const name = nameOf(this.data, selected);
    this.selected = selected && name !== null ? { selection: selected, name } : null;
  }
}

function nameOf(data: HomeData, selected: Selection | null): string | null {
  const thing = thingOf(data, selected);
  if (thing) return thingName(thing);
  const room = roomOf(data, selected) ?? robotRoomOf(data, selected);
  return room && roomName(room);
}
