"""Times the ICP of Open3D, small_gicp and KISS-ICP against viola's refinement: the same points, the same 100 starts, one
thread each, one run."""

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

# Before the import: Open3D reads it once.
os.environ["OMP_NUM_THREADS"] = "1"

import kiss_icp.mapping
import kiss_icp.registration
import numpy as np
import open3d as o3d
import small_gicp

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


def timed(align, starts):
    """The best time of RUNS over all starts, and the poses."""
    best, transforms = math.inf, []
    for _ in range(RUNS):
        since = time.perf_counter()
        transforms = [align(start) for start in starts]
        best = min(best, time.perf_counter() - since)
    return best, [flat(transform) for transform in transforms]


def flat_points(points_m):
    return np.pad(np.asarray(points_m, dtype=float), ((0, 0), (0, 1)))


def open3d_icp(data, reach_m):
    """Open3D's ICP, point to point, with its default criteria."""
    source, target = cloud(data["hits_m"]), cloud(data["map_m"])
    registration = o3d.pipelines.registration
    estimation = registration.TransformationEstimationPointToPoint()
    criteria = registration.ICPConvergenceCriteria()
    icp = registration.registration_icp
    return lambda start: icp(source, target, reach_m, start, estimation, criteria).transformation


def small_icp(data, reach_m):
    """small_gicp's ICP, point to point, with its default criteria. Its trees are built once."""
    source, target = (small_gicp.PointCloud(flat_points(data[name])) for name in ("hits_m", "map_m"))
    tree = small_gicp.KdTree(target)
    limits = {"registration_type": "ICP", "max_correspondence_distance": reach_m, "num_threads": 1}
    return lambda start: small_gicp.align(target, source, tree, init_T_target_source=start, **limits).T_target_source


def kiss_icp_step(data, reach_m):
    """KISS-ICP's registration with its default criteria and kernel of a third of the reach; all map points are kept."""
    voxels = kiss_icp.mapping.VoxelHashMap(voxel_size=reach_m, max_distance=1e3, max_points_per_voxel=1000)
    voxels.add_points(flat_points(data["map_m"]))
    points = flat_points(data["hits_m"])
    registration = kiss_icp.registration.Registration(500, 1e-4, 1)
    return lambda start: registration.align_points_to_map(points, voxels, start, reach_m, reach_m / 3)


PEERS = [
    (f"Open3D {o3d.__version__}", open3d_icp),
    (f"small_gicp {version('small_gicp')}", small_icp),
    (f"KISS-ICP {version('kiss-icp')}", kiss_icp_step),
]


def main():
    data = json.loads(Path(sys.argv[1]).read_text()) if len(sys.argv) > 1 else exported()
    truth, ours_s = data["truth"], data["viola"]["seconds"]
    starts = [matrix(start) for start in data["starts"]]
    print(f"{len(data['hits_m'])} hits, {len(data['map_m'])} map points, {len(starts)} starts, one thread, best of {RUNS}\n")
    print("| refinement | seconds | times viola's | right |\n|---|---|---|---|")

    def row(name, seconds, poses):
        right = sum(is_right(pose, truth) for pose in poses)
        print(f"| {name} | {seconds:.4f} | {seconds / ours_s:.1f} | {right} |")

    row("viola", ours_s, data["viola"]["poses"])
    for name, peer in PEERS:
        for reach_m in (0.2, 0.5, 2.0):
            row(f"{name}, pairs up to {reach_m} m", *timed(peer(data, reach_m), starts))


if __name__ == "__main__":
    main()
