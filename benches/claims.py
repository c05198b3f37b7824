"""The claims of BENCHMARKS.md: a command, its output, and the columns of its table. `benches/figures` measures and renders.

`settings` are the values of {names} in the commands for each run of benches/figures; a part without a row for `quick` is not measured
by it. `minutes` are estimates for two cores. `rows` makes rows of the finished runs, by label; a column is its name, format and value.
Tables use seeds from 5000 on. Nothing is tuned on them.
"""

import json
import re
from itertools import groupby
from statistics import median

FORMATS = {
    "": str,
    "int": lambda value: f"{value:.0f}",
    "%": lambda value: f"{100 * value:.1f} %",
    "deg": lambda value: f"{value:.2f}°",
    "m": lambda value: f"{value:.3f} m",
    "cm": lambda value: f"{100 * value:.1f} cm",
    "mm": lambda value: f"{1000 * value:.1f} mm",
    "s": lambda value: f"{value:.2f} s",
    "ms": lambda value: f"{1000 * value:.0f} ms",
    "min": lambda value: f"{value / 60:.1f} min",
    "MiB": lambda value: f"{value:.0f} MiB",
    "ratio": lambda value: f"{value:.3f}",
    "x": lambda value: f"{value:.1f}",
}


def json_rows(name, label="run"):
    """Rows of the first JSON file of each run, with the run's label."""
    def rows(runs):
        found = []
        for of, run in runs.items():
            content = run.json(name)
            content = content["rows"] if isinstance(content, dict) else content
            found += [{label: of} | row for row in content]
        return found
    return rows


def printed(runs):
    """Rows of the tables that the runs print, with the run's label."""
    return [{"run": label} | row for label, run in runs.items() for row in run.table()]


def of(name, format="", key=None):
    """A column with the value of a row's key."""
    return (name, format, lambda row: row.get(key or name))


def share(name, part, whole):
    """A column with a fraction of two counts."""
    return (name, "%", lambda row: row[part] / row[whole] if row[whole] else None)


def text(name, pattern):
    """A column of several values of a row as one text."""
    return (name, "", lambda row: pattern.format(**row))


ALIGNMENT = [
    of("set"), of("frames"), of("clips"), of("success", "%", "success_rate"), of("R median", "deg", "r_median_deg"),
    of("T median", "m", "t_median_m"), of("aligned", "%", "aligned_rate"), of("wrong", "%", "wrong_when_aligned"),
    of("calibration error", "ratio", "expected_calibration_error"),
]
FOUND = [ALIGNMENT[3], ALIGNMENT[6], ALIGNMENT[7]]
TIMES = [of("register", "s", "seconds_median"), of("total", "s", "seconds_total_median")]
SCENE = "viola evaluate --scene $SCENE $TRUTH"


def without_subsets(rows):
    """Rows of all clips, without those of the clips that show the floor."""
    return lambda runs: [row for row in rows(runs) if "(" not in row["set"]]


def maps(runs):
    rows = runs["run"].json("table.json")
    clips = sum(row["clips"] for row in rows)
    total = lambda key: sum((row[key] or 0) * row["clips"] for row in rows) / clips
    wrong = sum((row["wrong_when_aligned"] or 0) * row["aligned_rate"] * row["clips"] for row in rows)
    return [{"maps": len({row["set"] for row in rows}), "clips": clips, "found": total("success_rate"), "aligned": total("aligned_rate"),
             "wrong": wrong, "slowest": max(row["seconds_median"] for row in rows)}]


def stages(runs):
    rows = []
    for label, run in runs.items():
        seconds = run.json("out/result.json")["seconds"]
        found = sum(seconds.get(stage, 0) for stage in ("search", "refine", "decide"))
        rows.append({"clip": label, "time": run.seconds, "found": found, "peak": run.peak_mib})
    return rows


def pivot(key, across, name="table.json"):
    """Rows of the first run by the value of `key`; in each, the rows of all values of `across`. No rows of subsets of the clips."""
    def rows(runs):
        found = {}
        for row in next(iter(runs.values())).json(name):
            if "(" not in row["set"]:
                found.setdefault(row[key], {})[row[across]] = row
        return [{key: value, **{str(each): row for each, row in within.items()}} for value, within in found.items()]
    return rows


def each(values, columns):
    """The columns for each of the values that a row was pivoted across; none where a run did not have it."""
    return [(f"{name}, {value}", format, lambda row, value=value, of=of: of(row[value]) if value in row else None)
            for value in values for name, format, of in columns]


def beside(runs):
    rows = pivot("frames", "method")(runs)
    return [row | {"clips": row["viola"]["clips"], "ratio": row["paper"]["seconds_median"] / row["viola"]["seconds_median"]} for row in rows]


def floors(runs):
    return runs["run"].json("labels.json")["floors"]


def labels(runs):
    rows = json_rows("labels.json")(runs)
    return [row for row in rows if row["variant"] in ("single frames", "voting + geometry", "voting + augmentation + volume", "geometry", "volume")]


def homes(runs):
    """A row for each way to label, and the home's map."""
    rows = []
    for label, run in runs.items():
        report = run.json("home.json")
        placed = [excerpt for excerpt in report["excerpts"] if excerpt["placed_by"]]
        objects = report["score"]["oriented"]["total"]
        rows.append({
            "labels by": label, "clips": len(report["excerpts"]), "placed": len(placed),
            "wrong": sum(e["together_m"] >= 0.3 or e["together_deg"] >= 10 for e in placed),
            "alone_m": report["agreement"]["alone_m"], "together_m": report["agreement"]["together_m"],
            "accuracy": report["surface"]["accuracy"], "completeness": report["surface"]["completeness"],
            "single": report["labels"][0]["voxel_accuracy"], "fused": report["labels"][1]["voxel_accuracy"], **objects,
        })
    return rows


def simulated_homes(runs):
    rows = []
    for row in runs["run"].json("home.json"):
        plan, objects = row["plan"], row["objects"]["total"]
        within = sum(error <= 0.05 for error in plan["area_errors"])
        rows.append(plan | {"set": row["set"], "truth": objects["truth"], "found": objects["found"], "matched": objects["matched"],
                            "true_rooms": row["rooms"], "matched_rooms": row["matched"], "area": within})
    return rows


def changes(runs):
    """Right of reported changes of true ones, for each kind."""
    rows = runs["run"].json("changes.json")["rows"]
    told = lambda score: f"{score['right']} / {score['told']} / {score['truth']}"
    kept = lambda kept: f"{kept['one_id']} of {kept['objects']}" if kept["objects"] else "-"
    return [{"set": row["set"], "homes": row["homes"], "one id": kept(row["kept"])}
            | {kind: told(row["scores"][kind]) for kind in ("added", "moved", "gone")} for row in rows]


def metres(runs):
    rows = []
    for run in runs.values():
        for row in (row for row in run.json("table.json") if "(" not in row["set"]):
            scale = row["scale"]
            rows.append(row | ({"scale": scale["median"], "worst": scale["worst"]} if scale else {}))
    return rows


def tracks(runs):
    """A row for each recording and method: the error, and the shares of frames with a pose."""
    rows = []
    for label, run in runs.items():
        by_method = {}
        for row in run.json("track.json"):
            by_method.setdefault(row["method"], []).append(row)
        for method, clips in by_method.items():
            errors = [clip["errors"] for clip in clips if clip["errors"]]
            middle = lambda key: median(error[key] for error in errors)
            rows.append({"recording": label, "method": method, "clips": len(clips), "ate": middle("ate_m"), "path": middle("share_of_path"),
                         "worst": max(error["share_of_path"] for error in errors), "rotation": middle("rotation_deg"),
                         "tracked": sum(clip["tracked"] for clip in clips) / sum(clip["frames"] for clip in clips),
                         "time": median(clip["frame_ms"] for clip in clips) / 1000})
    return rows


def service(runs):
    """What the load tests print: a name, then the figures."""
    return [dict(zip(("what", "result"), line.split(": ", 1))) for run in runs.values() for line in run.stdout.splitlines() if ": " in line]


def million(runs):
    """One row of what benches/million_homes.sh prints: the longest time of each statement."""
    lines = re.findall(r"^ *([\d.]+) ms +(\d+)  (.*)$", runs["run"].stdout, re.M)
    times = [float(time) / 1000 for time, _, _ in lines]
    return [{"statements": len(times), "runs": sum(int(runs) for _, runs, _ in lines), "longest": max(times),
             "above": sum(time > 0.003 for time in times)}]


def video(runs):
    """A row for each clip, with the frames a second of both decoders."""
    found = {}
    for row in printed(runs):
        found.setdefault(row["clip"], {"clip": row["clip"]})[row["decoder"]] = row["frames/s"]
    return list(found.values())


PARTS = [
    {
        "name": "apartment", "title": "The real apartment", "needs": ["VIOLA_TEST_DATA"],
        "note": "All half-overlapping excerpts of scene0000_00. `T` is the error of translation.",
        "runs": {"run": SCENE + " --frames {frames} --out {out}"},
        "settings": {"tiny": {"frames": "60"}, "quick": {"frames": "60,40,20,10,5"}, "all": {"frames": "60,40,20,10,5"}},
        "minutes": {"tiny": 1, "quick": 3, "all": 3},
        "rows": without_subsets(json_rows("table.json")), "columns": ALIGNMENT[1:4] + ALIGNMENT[5:] + TIMES,
    },
    {
        "name": "paper", "title": "Beside the paper's method", "needs": ["VIOLA_TEST_DATA"],
        "note": "The paper's method with its authors' constants, on the same clips.",
        "runs": {"run": SCENE + " --frames {frames} --methods paper,viola{clips} --out {out}"},
        "settings": {"tiny": {"frames": "60", "clips": " --clips 1"}, "quick": {"frames": "60,20,10,5", "clips": " --clips 8"},
                     "all": {"frames": "60,40,20,10,5", "clips": ""}},
        "minutes": {"tiny": 1, "quick": 2, "all": 11},
        "rows": beside,
        "columns": [of("frames"), of("clips")] + each(["paper", "viola"], [ALIGNMENT[3], TIMES[0]]) + [of("ratio", "int")],
    },
    {
        "name": "simulated", "title": "Simulated homes", "needs": [],
        "note": "[CONTRIBUTING](CONTRIBUTING.md#evaluation) describes the sets.",
        "runs": {"run": "viola evaluate --set {sets} --seeds {seeds} --clips 1 --frames {frames} --out {out}"},
        "settings": {"tiny": {"sets": "normal,storeys", "seeds": "2000..2001", "frames": "10"},
                     "quick": {"sets": "normal,upper,repeated,changed,storeys,drifted,glass", "seeds": "5000..5010", "frames": "60,10"},
                     "all": {"sets": "normal,upper,repeated,changed,storeys,drifted,glass", "seeds": "5000..5100", "frames": "60,10"}},
        "minutes": {"tiny": 1, "quick": 3, "all": 30}, "rows": pivot("set", "frames"),
        "columns": [of("set"), ("clips", "", lambda row: row.get("60", row.get("10"))["clips"]), *each(["60", "10"], FOUND)],
    },
    {
        "name": "maps", "title": "Vacuums' own maps", "needs": ["VIOLA_TEST_DATA"],
        "note": "Clips drawn inside each real map, with 30 % outliers and 3 cm of noise.",
        "runs": {"run": "viola evaluate $(find $DATA/vacuum_maps -name '*.json' -o -name '*.yaml' | sort | sed 's/^/--map /') \\\n"
                        "  --clips {clips} --out {out}"},
        "settings": {"tiny": {"clips": "1"}, "quick": {"clips": "10"}, "all": {"clips": "50"}},
        "minutes": {"tiny": 1, "quick": 1, "all": 2}, "rows": maps,
        "columns": [of("maps"), of("clips"), of("found", "%"), of("aligned", "%"), of("wrong", "int"),
                    of("register, slowest map", "ms", "slowest")],
    },
    {
        "name": "clip", "title": "A clip's zip to its pose", "needs": ["VIOLA_TEST_DATA"], "repeat": 3,
        "note": "Median of three runs. Required are 6 s and 700 MiB for 60 frames.",
        "prepare": "(cd $SCENE && zip -q - intrinsic/* {color,depth,pose}/1[2-7]?.*) > target/60.zip\n"
                   "(cd $SCENE && zip -qr - intrinsic color depth pose) > target/300.zip",
        "runs": {frames + " frames": f"viola align --clip target/{frames}.zip --lidar $SCENE/lidar/valetudo.json --out {{out}}/out"
                 for frames in ("60", "300")},
        "settings": {"tiny": {}, "quick": {}, "all": {}}, "minutes": {"tiny": 1, "quick": 1, "all": 1}, "rows": stages,
        "columns": [of("clip"), of("time", "s"), of("search, refinement, score", "ms", "found"), of("peak memory", "MiB", "peak")],
    },
    {
        "name": "floors", "title": "Floors", "needs": ["VIOLA_TEST_DATA"],
        "note": "Excerpts of the real apartment, by shape alone. Right is within 1 degree and 2 cm of the labelled floor.",
        "runs": {"run": "viola evaluate --scene $SCENE --labels --frames {frames} --out {out}"},
        "settings": {"tiny": {"frames": "60"}, "quick": {"frames": "60,40,20,10,5"}, "all": {"frames": "60,40,20,10,5"}},
        "minutes": {"tiny": 1, "quick": 3, "all": 3}, "rows": floors,
        "columns": [of("frames"), of("excerpts"), of("see the floor", "", "see_floor"), of("right", "", "within"),
                    of("R median", "deg", "median_deg"), of("height, median", "cm", "median_m")],
    },
    {
        "name": "labels", "title": "Classes of points", "needs": ["VIOLA_TEST_DATA", "VIOLA_MODELS"],
        "note": "`volume` is the built-in network; frames and voting are by DeepLab.",
        "runs": {"real": "viola evaluate --scene $SCENE --labels --frames 60 --models $MODELS --out {out}",
                 "simulated": "viola evaluate --set normal,changed --seeds {seeds} --frames {frames} --labels --out {out}"},
        "settings": {"tiny": {"seeds": "2000..2001", "frames": "8"}, "quick": {"seeds": "5000..5003", "frames": "20"},
                     "all": {"seeds": "5000..5010", "frames": "8,20,45"}},
        "minutes": {"tiny": 4, "quick": 4, "all": 8}, "rows": labels,
        "columns": [of("homes", "", "run"), of("variant"), of("right", "%", "voxel_accuracy"), of("structure", "%", "structure_accuracy"),
                    of("mean IoU", "ratio", "mean_iou"),
                    of("calibration error", "ratio", "calibration_error")],
    },
    {
        "name": "home", "title": "A home's map", "needs": ["VIOLA_TEST_DATA", "VIOLA_MODELS"],
        "note": "Excerpts of 40 frames: disagreement of overlaps, points within 5 cm of the mesh, objects by turned boxes.",
        "runs": {"DeepLab": "viola evaluate --scene $SCENE $TRUTH --home --frames 40 --models $MODELS --out {out}",
                 "built-in": "viola evaluate --scene $SCENE $TRUTH --home --frames 40 --out {out}"},
        "settings": {"tiny": {}, "quick": {}, "all": {}}, "minutes": {"tiny": 4, "quick": 2, "all": 2}, "rows": homes,
        "columns": [of("labels by"), text("placed", "{placed} of {clips}"), of("wrong"), of("overlaps, alone", "mm", "alone_m"),
                    of("together", "mm", "together_m"), of("accuracy", "%"), of("classes, single", "%", "single"),
                    of("fused", "%"), text("objects", "{matched} of {truth}"), share("precision", "matched", "found")],
    },
    {
        "name": "homes", "title": "Objects and plan of simulated homes", "needs": [],
        "note": "Points of the true surface; at least 75 % of patches named right. Faces within 10 cm and 3 degrees, areas within 5 %.",
        "runs": {"run": "viola evaluate --home --set normal --seeds {seeds} --picture-labels 0.75 --out {out}"},
        "settings": {"tiny": {"seeds": "2000..2001"}, "quick": {"seeds": "5000..5050"}, "all": {"seeds": "5000..5050"}},
        "minutes": {"tiny": 2, "quick": 1, "all": 1}, "rows": simulated_homes,
        "columns": [text("objects", "{matched} of {truth}"), share("precision", "matched", "found"), text("rooms", "{matched_rooms} of {true_rooms}"),
                    share("faces, recall", "found_faces", "true_faces"), share("precision", "right_faces", "drawn_faces"),
                    text("doors", "{found_doors} of {doors}"), text("windows", "{found_windows} of {windows}"),
                    share("openings, precision", "right_openings", "drawn_openings"), text("areas", "{area} of {rooms}")],
    },
    {
        "name": "joint", "title": "Clips placed together", "needs": [],
        "note": "A clip is decidable if the others at their true poses give its true pose 0.95.",
        "runs": {"run": "viola evaluate --joint --set repeated,normal --seeds {seeds} --frames 10{clips} --out {out}"},
        "settings": {"tiny": {"seeds": "2000..2001", "clips": " --clips 4"}, "quick": {"seeds": "5000..5001", "clips": ""},
                     "all": {"seeds": "5000..5005", "clips": ""}},
        "minutes": {"tiny": 1, "quick": 2, "all": 8}, "rows": json_rows("joint.json"),
        "columns": [of("set"), of("clips"), of("aligned", "", "aligned"), of("wrong", "", "aligned_wrong"),
                    of("decidable"), of("of these placed", "", "decidable_placed"), of("placed"), of("wrong", "", "placed_wrong"),
                    ("calibration error", "ratio", lambda row: (row["calibration"] or {}).get("expected_calibration_error"))],
    },
    {
        "name": "changes", "title": "Changes of objects", "needs": [],
        "note": "Right / reported / true. Homes of `changed` are filmed in two visits; in `normal` nothing changes, and clips come one by one.",
        "runs": {"run": "viola evaluate --changes --set {sets} --seeds {seeds} --clips {clips} --frames 30 \\\n  --picture-labels 0.75 --out {out}"},
        "settings": {"tiny": {"sets": "changed", "seeds": "2000..2001", "clips": "2"}, "quick": {"sets": "normal,changed", "seeds": "5000..5001", "clips": "5"},
                     "all": {"sets": "normal,changed", "seeds": "5000..5006", "clips": "12"}},
        "minutes": {"tiny": 1, "quick": 3, "all": 10}, "rows": changes,
        "columns": [of("set"), of("homes"), of("one id"), of("added"), of("moved"), of("gone")],
    },
    {
        "name": "metres", "title": "Clips without metres", "needs": ["VIOLA_TEST_DATA"],
        "note": "Poses and depth are divided by a factor of 0.2 to 5, and the unit is withheld.",
        "runs": {"real": SCENE + " --frames 40{clips} --rescale --out {out}",
                 "simulated": "viola evaluate --set {sets} --seeds {seeds} --clips 1 --frames {frames} --rescale --out {out}"},
        "settings": {"tiny": {"clips": " --clips 1", "sets": "normal", "seeds": "2000..2001", "frames": "20"},
                     "quick": {"clips": " --clips 4", "sets": "normal,changed", "seeds": "5000..5001", "frames": "60"},
                     "all": {"clips": "", "sets": "normal,changed", "seeds": "5000..5010", "frames": "60"}},
        "minutes": {"tiny": 1, "quick": 2, "all": 10}, "rows": metres,
        "columns": [of("set"), of("clips"), *FOUND, of("scale, median error", "%", "scale"), of("worst", "%")],
    },
    {
        "name": "tracking", "title": "Tracking without poses", "needs": ["VIOLA_TEST_DATA"],
        "note": "Poses are withheld. The worst clip's error is a share of its path.",
        "runs": {"RedKitchen": "viola evaluate --track --scene $DATA/seven_scenes/redkitchen --out {out}",
                 "TUM freiburg1_rpy": "viola evaluate --track --scene $DATA/tum/freiburg1_rpy_excerpt --out {out}",
                 "simulated": "viola evaluate --track --set {sets} --seeds {seeds} --frames {frames} --out {out}"},
        "settings": {"tiny": {"sets": "normal", "seeds": "2000..2001", "frames": "30"},
                     "quick": {"sets": "normal,upper", "seeds": "5000..5002", "frames": "120"},
                     "all": {"sets": "normal,upper,repeated,changed", "seeds": "5000..5016", "frames": "120"}},
        "minutes": {"tiny": 2, "quick": 1, "all": 15}, "rows": lambda runs: [row for row in tracks(runs) if row["method"] == "viola"],
        "columns": [of("recording"), of("clips"), of("ATE", "cm", "ate"), of("worst clip", "%", "worst"),
                    of("tracked", "%"), of("a frame", "ms", "time")],
    },
    {
        "name": "completion", "title": "Completion", "needs": ["VIOLA_FETCHED_MODELS"],
        "note": "`complete-all` and `complete-gated` complete by pictures.",
        "runs": {"run": "viola evaluate --set upper,normal --seeds {seeds} --clips 1 --frames {frames} --models $FETCHED \\\n"
                        "  --methods complete-base,complete-all,complete-gated,complete-structure --out {out}"},
        "settings": {"tiny": {"seeds": "2000..2001", "frames": "8"}, "all": {"seeds": "5000..5020", "frames": "60"}},
        "minutes": {"tiny": 2, "all": 10}, "rows": pivot("method", "set"),
        "columns": [of("method"), *each(["upper", "normal"], FOUND)],
    },
    {
        "name": "merges", "title": "Merging a clip into a home", "needs": [],
        "note": "Timed clips. `windows` of the map are labelled again; `labels` and `description` are part of `sum`.",
        "runs": {"home": "cargo run --release --quiet --example merges -- home timed {home}",
                 "one room": "cargo run --release --quiet --example merges -- room timed {room}"},
        "settings": {"tiny": {"home": "3", "room": "2"}, "quick": {"home": "20 200", "room": "40"}, "all": {"home": "5 20 200", "room": "40"}},
        "minutes": {"tiny": 3, "quick": 3, "all": 8}, "rows": printed,
        "columns": [of("in", "", "run"), of("clips"), of("clips read"), of("windows"), of("labels"),
                    of("description"), of("sum"), of("peak memory")],
    },
    {
        "name": "attacks", "title": "All attacks at once", "needs": [],
        "note": "An honest tenant's reads and uploads while another one attacks, and the server's memory.",
        "runs": {"run": "benches/attacks.py $(command -v viola) {seconds}"},
        "settings": {"tiny": {"seconds": "3"}, "quick": {"seconds": "20"}, "all": {"seconds": "60"}},
        "minutes": {"tiny": 1, "quick": 1, "all": 3}, "rows": printed,
        "columns": [of("while"), of("reads"), of("median"), of("99 %"), of("uploads"), of("longest upload"),
                    of("refused"), of("peak memory")],
    },
    {
        "name": "service", "title": "The service under load", "needs": ["VIOLA_TEST_POSTGRES"],
        "note": "Required are 1000 claims a second, 99 % of new jobs claimed within 50 ms, and 99 % of 1000 reads a second within 20 ms.",
        "runs": {"queue": "cargo run --release --quiet --example load -- queue $POSTGRES",
                 "reads": "benches/reads.sh {rate} {seconds}"},
        "settings": {"tiny": {"rate": "50", "seconds": "3"}, "quick": {"rate": "1000", "seconds": "20"}, "all": {"rate": "1000", "seconds": "20"}},
        "minutes": {"tiny": 1, "quick": 1, "all": 1}, "rows": service, "columns": [of("load", "", "what"), of("result")],
    },
    {
        "name": "million", "title": "A million homes", "needs": ["VIOLA_TEST_POSTGRES"],
        "note": "By PostgreSQL's `auto_explain`.",
        "runs": {"run": "benches/million_homes.sh $POSTGRES {homes}"},
        "settings": {"tiny": {"homes": "1000"}, "all": {"homes": "1000000"}}, "minutes": {"tiny": 1, "all": 15},
        "rows": million, "columns": [of("kinds of statements", "", "statements"), of("runs"), of("above 3 ms", "", "above"), of("longest", "ms")],
    },
    {
        "name": "video", "title": "Video", "needs": ["VIOLA_TEST_DATA"],
        "note": "Frames a second at 1920x1440, only decoding, two threads. Required are 25.",
        "runs": {"run": "benches/video.sh $SCENE/color"}, "settings": {"all": {}}, "minutes": {"all": 4}, "rows": video,
        "columns": [of("clip"), of("viola"), of("ffmpeg")],
    },
    {
        "name": "peers", "title": "Beside other programs", "needs": [],
        "note": "100 starts in one simulated home, one thread each.",
        "runs": {"run": "benches/peers/run"},
        "settings": {"all": {}}, "minutes": {"all": 3},
        "rows": lambda runs: [row for row in printed(runs) if row["refinement"] == "viola" or row["refinement"].endswith("0.5 m")],
        "columns": [of("refinement"), of("seconds"), of("times viola's"), of("right")],
    },
    {
        "name": "compile", "title": "Compiling", "needs": [],
        "note": "From the edit of a line to a running development binary.",
        "runs": {"a route": "benches/edit.sh 'a route' src/api/homes.rs StatusCode::CREATED StatusCode::ACCEPTED",
                 "the search": "benches/edit.sh 'the search' crates/viola-align/src/search.rs 'hits: 128,' 'hits: 129,'"},
        "settings": {"all": {}}, "minutes": {"all": 5},
        "rows": lambda runs: [row | {"time": float(row["time"])} for row in printed(runs)],
        "columns": [of("edit of"), of("time", "s")],
    },
]


def apartment_claim(rows):
    """Numbers of frames with the same success stand together."""
    groups = groupby(rows, lambda row: f"{100 * row['success']:.1f} %")
    shares = [f"{share} with {', '.join(str(row['frames']) for row in of_share)}" for share, of_share in groups]
    wrong = sum((row["wrong"] or 0) * row["aligned"] * row["clips"] for row in rows)
    return f"{'; '.join(shares)} frames; {wrong:.0f} of {sum(row['clips'] for row in rows)} wrong and `aligned`"


def simulated_claim(rows):
    aligned = sum((row["aligned, 60"] or 0) * row["clips"] for row in rows)
    wrong = sum((row["wrong, 60"] or 0) * (row["aligned, 60"] or 0) * row["clips"] for row in rows)
    return f"{aligned:.0f} of {sum(row['clips'] for row in rows)} called `aligned`, {wrong:.0f} of them wrong"


def clip_claim(rows):
    return f"{rows[0]['time']:.2f} s, {rows[0]['peak memory']:.0f} MiB"


# Rows of the README's table: the claim, its part, and the result from the part's rows.
README = [
    ("Real clips within 10 degrees and 0.3 m", "apartment", apartment_claim),
    ("Clips of 60 frames in seven sets of simulated homes", "simulated", simulated_claim),
    ("A clip's zip (60 frames) to its pose, two cores", "clip", clip_claim),
]
