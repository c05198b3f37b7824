// Other words that people use for the classes of objects, for the search. A class also holds kindred things, as the mappings
// in `taxonomy/` of viola-geometry say: a dishwasher is a washing machine there, and a bin a box.

const SYNONYMS: Record<string, string> = {
  animal: "pet cat dog bird",
  bathtub: "bath",
  bed: "cot bunk cradle mattress blanket",
  box: "crate carton cardboard bin trash rubbish garbage waste basket bag suitcase backpack",
  cabinet: "cupboard closet wardrobe dresser drawers sideboard chest buffet",
  chair: "seat stool armchair recliner bench ottoman",
  clothes: "clothing garment towel",
  counter: "worktop kitchen unit island",
  curtain: "drapes blind",
  desk: "workplace bureau",
  door: "gate",
  lamp: "light lantern chandelier sconce",
  picture: "painting poster photo frame",
  pillow: "cushion",
  plant: "flower vase pot",
  radiator: "heater heating",
  refrigerator: "fridge freezer",
  rug: "carpet mat",
  shelf: "bookcase shelves rack",
  sink: "basin washbasin",
  sofa: "couch settee",
  stairs: "staircase steps",
  stove: "oven cooker hob range microwave hood",
  television: "tv telly screen monitor computer laptop",
  toilet: "wc loo lavatory",
  washing_machine: "washer laundry dryer dishwasher",
  window: "pane",
};

/** Other words for a class, separated by spaces; empty if there are none. */
export function synonymsOf(name: string): string {
  return SYNONYMS[name] ?? "";
}
