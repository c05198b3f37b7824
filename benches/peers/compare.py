"""Times Open3D's ICP against viola's refinement: the same points, the same 100 starts, one thread each, one run."""

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# Before the import: Open3D reads it once.
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
import open3d as o3d

ROOT = Path(__file__).resolve().parents[2]
RUNS = 5


def exported():
    """Points, starts and viola's own time, from the example `peers`, built with optimisation."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "peers.json"
        command = ["cargo", "run", "--release", "--quiet", "--example", "peers", "--", str(path)]
        subprocess.run(command, cwd=ROOT, check=True)
        return json.loads(path.read_text())


def cloud(points_m):
    """Points of the plane as a cloud at z = 0."""
    points = np.zeros((len(points_m), 3))
    points[:, :2] = points_m
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))


def matrix(pose):
    x_m, y_m, yaw_rad = pose
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0, x_m], [s, c, 0, y_m], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)


def flat(transform):
    return transform[0, 3], transform[1, 3], math.atan2(transform[1, 0], transform[0, 0])


def is_right(pose, truth):
    """The paper's success: under 10 degrees and 0.3 m."""
    turn = (pose[2] - truth[2] + math.pi) % (2 * math.pi) - math.pi
    return math.hypot(pose[0] - truth[0], pose[1] - truth[1]) < 0.3 and abs(turn) < math.radians(10)


def open3d_icp(data, reach_m):
    """Open3D's ICP, point to point, with its default criteria. The best time of RUNS."""
    source, target = cloud(data["hits_m"]), cloud(data["map_m"])
    starts = [matrix(start) for start in data["starts"]]
    registration = o3d.pipelines.registration
    estimation = registration.TransformationEstimationPointToPoint()
    criteria = registration.ICPConvergenceCriteria()
    best = math.inf
    for _ in range(RUNS):
        since = time.perf_counter()
        results = [
            registration.registration_icp(source, target, reach_m, start, estimation, criteria)
            for start in starts
        ]
        best = min(best, time.perf_counter() - since)
    return best, [flat(result.transformation) for result in results]


def main():
    data = json.loads(Path(sys.argv[1]).read_text()) if len(sys.argv) > 1 else exported()
    truth, ours_s = data["truth"], data["viola"]["seconds"]
    counts = f"{len(data['hits_m'])} hits, {len(data['map_m'])} map points, {len(data['starts'])} starts"
    print(f"{counts}, one thread, Open3D {o3d.__version__}, best of {RUNS}\n")
    print("| refinement | seconds | times viola's | right |\n|---|---|---|---|")

    def row(name, seconds, poses):
        right = sum(is_right(pose, truth) for pose in poses)
        print(f"| {name} | {seconds:.4f} | {seconds / ours_s:.1f} | {right} |")

    row("viola", ours_s, data["viola"]["poses"])
    for reach_m in (0.2, 0.5, 2.0):
        seconds, poses = open3d_icp(data, reach_m)
        row(f"Open3D ICP, pairs up to {reach_m} m", seconds, poses)


if __name__ == "__main__":
    main()
