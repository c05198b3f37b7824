"""Opens the files of a home by the readers of other programs, and compares them with the truth.

    check.py FOLDER [FILE ...]

Prints a line for each file, and fails with the first difference. `tests/api/foreign.rs` and `tests/method/map.rs` make
the folder; the packages are in `requirements.txt`.
"""

import sys

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
    "home.mcap": recording.mcap,
    "valetudo.json": robots.valetudo,
    "calibration.json": robots.calibration,
    "matter.json": robots.matter,
}


def main():
    truth = Truth(sys.argv[1])
    truth.is_the_room(truth.xyz)
    for name in sys.argv[2:] or FILES:
        print(f"{name}: {FILES[name](truth)}", flush=True)


main()
