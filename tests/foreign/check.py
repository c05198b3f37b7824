"""Opens the files of a home by the readers of other programs, and compares them with the truth.

    check.py [--level LEVEL] FOLDER [FILE ...]

The files are those of one level of the home, by default of `main`. Prints a line for each file, and fails with the first
difference. `tests/api/foreign.rs` and `tests/method/map.rs` make the folder; the packages are in `requirements.txt`.
"""

import argparse

import plans
import points
import recording
import robots
import surfaces
from truth import Truth

FILES = {
    "points.laz": points.laz,
    "points.e57": points.e57,
    "points.glb": points.glb,
    "empty.laz": points.empty_laz,
    "empty.e57": points.empty_e57,
    "mesh.glb": surfaces.glb,
    "mesh.obj": surfaces.obj,
    "mesh.usdz": surfaces.usdz,
    "plan.dxf": plans.dxf,
    "plan.pdf": plans.pdf,
    "plan.png": plans.png,
    "plan.geojson": plans.geojson,
    "home.mcap": recording.mcap,
    "nav2.zip": robots.nav2,
    "valetudo.json": robots.valetudo,
    "calibration.json": robots.calibration,
    "matter.json": robots.matter,
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--level", default="main")
    parser.add_argument("folder")
    parser.add_argument("files", nargs="*")
    arguments = parser.parse_args()
    truth = Truth(arguments.folder, arguments.level)
    truth.is_the_room(truth.xyz)
    for name in arguments.files or FILES:
        print(f"{name}: {FILES[name](truth)}", flush=True)


main()
