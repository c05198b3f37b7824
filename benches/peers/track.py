"""Follows a recording with Open3D's RGB-D odometry and with its reconstruction pipeline, and has viola judge all of them
beside its own tracking: the same frames, one run.

    python3 benches/peers/track.py RECORDING REPORT

Open3D 0.19.0 and opencv-python-headless (PyPI); 0.20.0 fuses nothing into its ScalableTSDFVolume, which leaves the pipeline without surfaces. VIOLA is
the binary, if not the release build's."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d

ROOT = Path(__file__).resolve().parents[2]
ODOMETRY = o3d.pipelines.odometry
REGISTRATION = o3d.pipelines.registration
# The pipeline's own defaults (its config: n_frames_per_fragment 100, n_keyframes_per_n_frame 5, voxel_size 0.05).
FRAGMENT = 100
KEYS = 5
VOXEL_M = 0.05
# Maximum depth of the odometry. The pipeline's default is 3 m, but the clips reach further.
MAX_DEPTH_M = 4.0


def seven_scenes(folder):
    """Colour, depth, units a metre, and the camera, as viola's reader has them."""
    depths = sorted(folder.glob("frame-*.depth.png"))
    pairs = [(path.with_name(path.name.replace(".depth.png", ".color.jpg")), path) for path in depths]
    camera = o3d.camera.PinholeCameraIntrinsic(640, 480, 585, 585, 320, 240)
    return pairs, 1000.0, camera


def tum(folder):
    def listed(name):
        lines = (folder / name).read_text().splitlines()
        rows = [line.split() for line in lines if line and not line.startswith("#")]
        return [(float(row[0]), folder / row[1]) for row in rows]

    colors, pairs = listed("rgb.txt"), []
    for time_s, depth in listed("depth.txt"):
        gap, color = min((abs(other - time_s), path) for other, path in colors)
        if gap <= 0.02:
            pairs.append((color, depth))
    camera = o3d.camera.PinholeCameraIntrinsic(640, 480, 525, 525, 319.5, 239.5)
    return pairs, 5000.0, camera


def load(folder):
    pairs, units, camera = tum(folder) if (folder / "rgb.txt").exists() else seven_scenes(folder)
    frames = []
    for color, depth in pairs:
        values = np.array(o3d.io.read_image(str(depth)))
        # The sensor's way to say that it has given up.
        values[values == 65535] = 0
        colored = o3d.geometry.RGBDImage.create_from_color_and_depth
        picture, distance = o3d.io.read_image(str(color)), o3d.geometry.Image(values)
        grey = colored(picture, distance, units, MAX_DEPTH_M, True)
        full = colored(picture, distance, units, MAX_DEPTH_M, False)
        frames.append((grey, full))
    return frames, camera


def by_corners(frames, camera, source, target):
    """Where the pipeline starts for frames that are apart: target from source by ORB corners with depth; none when it
    fails. The pipeline's own sample does this with OpenCV and leaves such frames out without it."""
    def corners(frame):
        grey = (255 * np.asarray(frame[0].color)).astype(np.uint8)
        return cv2.ORB_create(nfeatures=1000).detectAndCompute(grey, None), np.asarray(frame[0].depth)

    ((points_a, words_a), depth_a), ((points_b, words_b), depth_b) = corners(frames[source]), corners(frames[target])
    if words_a is None or words_b is None:
        return None
    matrix = camera.intrinsic_matrix
    rays, pairs = np.linalg.inv(matrix), []
    for match in cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(words_a, words_b):
        spots = points_a[match.queryIdx].pt, points_b[match.trainIdx].pt
        far = [depth[int(v), int(u)] for depth, (u, v) in zip((depth_a, depth_b), spots)]
        if min(far) > 0.3:
            pairs.append([rays @ (u, v, 1.0) * z for (u, v), z in zip(spots, far)])
    if len(pairs) < 10:
        return None
    pairs, rng, best = np.array(pairs), np.random.default_rng(0), (0, None)

    def rigid(chosen):
        a, b = chosen[:, 0], chosen[:, 1]
        u, _, vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
        turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
        return turn, b.mean(0) - turn @ a.mean(0)

    def near(motion):
        return np.linalg.norm(pairs[:, 0] @ motion[0].T + motion[1] - pairs[:, 1], axis=1) < 0.05

    for _ in range(300):
        motion = rigid(pairs[rng.choice(len(pairs), 3, replace=False)])
        best = max(best, (near(motion).sum(), motion), key=lambda found: found[0])
    if best[0] < 10:
        return None
    start = np.identity(4)
    start[:3, :3], start[:3, 3] = rigid(pairs[near(best[1])])
    return start


def step(frames, camera, source, target):
    """Target from source, with its information; none when it failed."""
    jacobian = ODOMETRY.RGBDOdometryJacobianFromHybridTerm()
    option = ODOMETRY.OdometryOption(depth_diff_max=0.07, depth_max=MAX_DEPTH_M)
    start = np.identity(4) if abs(source - target) == 1 else by_corners(frames, camera, source, target)
    if start is None:
        return None
    ok, motion, information = ODOMETRY.compute_rgbd_odometry(
        frames[source][0], frames[target][0], camera, start, jacobian, option
    )
    return (motion, information) if ok else None


def odometry(frames, camera):
    poses = [np.identity(4)]
    for now in range(1, len(frames)):
        found = step(frames, camera, now, now - 1)
        motion = found[0] if found else np.identity(4)
        poses.append(poses[-1] @ motion)
    return poses


def optimised(graph, distance_m, loops):
    """`loops` is the pipeline's preference_loop_closure_odometry or _registration."""
    option = REGISTRATION.GlobalOptimizationOption(
        max_correspondence_distance=distance_m,
        edge_prune_threshold=0.25,
        preference_loop_closure=loops,
        reference_node=0,
    )
    method = REGISTRATION.GlobalOptimizationLevenbergMarquardt()
    criteria = REGISTRATION.GlobalOptimizationConvergenceCriteria()
    REGISTRATION.global_optimization(graph, method, criteria, option)
    return [node.pose for node in graph.nodes]


def fragment(frames, camera, first, last):
    """Poses of the frames of a fragment in its first camera, and its surface."""
    graph, world = REGISTRATION.PoseGraph(), np.identity(4)
    graph.nodes.append(REGISTRATION.PoseGraphNode(world))
    for source in range(first, last):
        for target in range(source + 1, last):
            is_next = target == source + 1
            if not is_next and (source % KEYS or target % KEYS):
                continue
            found = step(frames, camera, source, target)
            if is_next:
                motion, information = found or (np.identity(4), np.identity(6))
                world = motion @ world
                graph.nodes.append(REGISTRATION.PoseGraphNode(np.linalg.inv(world)))
            elif found:
                motion, information = found
            else:
                continue
            edge = REGISTRATION.PoseGraphEdge(source - first, target - first, motion, information, uncertain=not is_next)
            graph.edges.append(edge)
    poses = optimised(graph, 0.07, 0.1)
    volume = o3d.pipelines.integration.ScalableTSDFVolume(
        voxel_length=3.0 / 512.0, sdf_trunc=0.04, color_type=o3d.pipelines.integration.TSDFVolumeColorType.RGB8
    )
    for pose, (_, full) in zip(poses, frames[first:last]):
        volume.integrate(full, camera, np.linalg.inv(pose))
    cloud = volume.extract_point_cloud().voxel_down_sample(VOXEL_M)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=VOXEL_M * 2, max_nn=30))
    return poses, cloud


def registered(source, target, start):
    result = REGISTRATION.registration_icp(
        source, target, VOXEL_M * 1.4, start, REGISTRATION.TransformationEstimationPointToPlane()
    )
    information = REGISTRATION.get_information_matrix_from_point_clouds(
        source, target, VOXEL_M * 1.4, result.transformation
    )
    return result, information


def pipeline(frames, camera):
    """Fragments, their registration, and the graph of both (Choi et al., 2015; Park et al., 2017)."""
    firsts = list(range(0, len(frames), FRAGMENT))
    parts = [fragment(frames, camera, first, min(first + FRAGMENT, len(frames))) for first in firsts]
    graph, world = REGISTRATION.PoseGraph(), np.identity(4)
    graph.nodes.append(REGISTRATION.PoseGraphNode(world))
    for source in range(len(parts)):
        for target in range(source + 1, len(parts)):
            if target == source + 1:
                last = min(firsts[source] + FRAGMENT, len(frames)) - 1
                found = step(frames, camera, last, firsts[target])
                joint = found[0] if found else np.identity(4)
                start = joint @ np.linalg.inv(parts[source][0][-1])
                result, information = registered(parts[source][1], parts[target][1], start)
                world = result.transformation @ world
                graph.nodes.append(REGISTRATION.PoseGraphNode(np.linalg.inv(world)))
                edge = REGISTRATION.PoseGraphEdge(source, target, result.transformation, information, uncertain=False)
                graph.edges.append(edge)
                continue
            radius = o3d.geometry.KDTreeSearchParamHybrid(radius=VOXEL_M * 5, max_nn=100)
            features = [REGISTRATION.compute_fpfh_feature(parts[part][1], radius) for part in (source, target)]
            guess = REGISTRATION.registration_fgr_based_on_feature_matching(
                parts[source][1],
                parts[target][1],
                *features,
                REGISTRATION.FastGlobalRegistrationOption(maximum_correspondence_distance=VOXEL_M * 1.4),
            )
            result, information = registered(parts[source][1], parts[target][1], guess.transformation)
            smaller = min(len(parts[source][1].points), len(parts[target][1].points))
            if information[5, 5] / smaller >= 0.3:
                edge = REGISTRATION.PoseGraphEdge(source, target, result.transformation, information, uncertain=True)
                graph.edges.append(edge)
    places = optimised(graph, VOXEL_M * 1.4, 5.0) if len(parts) > 1 else [np.identity(4)]
    return [place @ pose for place, (poses, _) in zip(places, parts) for pose in poses]


def main():
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    frames, camera = load(folder)
    rows = []
    for method, run in [("Open3D RGB-D odometry", odometry), ("Open3D reconstruction", pipeline)]:
        since = time.perf_counter()
        poses = run(frames, camera)
        seconds = time.perf_counter() - since
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        row = {
            "clip": folder.name,
            "method": f"{method} {o3d.__version__}",
            "poses": [pose.tolist() for pose in poses],
            "frame_ms": 1e3 * seconds / len(frames),
            "memory_mb": peak_mb,
        }
        rows.append(row)
        print(f"{method}: {seconds:.0f} s", file=sys.stderr)
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "trajectories.json"
        path.write_text(json.dumps(rows))
        # After the others have ended, so that nobody takes another's cores.
        binary = Path(os.environ.get("VIOLA", ROOT / "target" / "release" / "viola"))
        if not binary.exists():
            subprocess.run(["cargo", "build", "--release", "--bin", "viola"], cwd=ROOT, check=True)
        command = [binary, "evaluate", "--track", "--scene", folder, "--trajectories", path, "--out", out]
        subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
