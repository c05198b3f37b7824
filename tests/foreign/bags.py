"""Writes a recording as ROS 2 bags with other programs' writers.

    bags.py FOLDER

`FOLDER/recording.json` has the frames. The bags are `rosbags_sqlite3/` and `rosbags_mcap/` by rosbags, `zstd.mcap` and
`lz4.mcap` by mcap-ros2-support. `tests/readers/foreign_bags.rs` reads them.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
OPTICAL = "camera_color_optical_frame"


def kind(name):
    return STORE.types[name]


def header(time_s, frame):
    seconds = math.floor(time_s)
    stamp = kind("builtin_interfaces/msg/Time")(sec=seconds, nanosec=round((time_s - seconds) * 1e9))
    return kind("std_msgs/msg/Header")(stamp=stamp, frame_id=frame)


def vector(name, values):
    return kind(f"geometry_msgs/msg/{name}")(**dict(zip("xyz", map(float, values))))


def quaternion(rotation):
    """Returns the rotation with w above all: the largest of four candidates is exact."""
    r = rotation
    squares = [1 + r[0, 0] - r[1, 1] - r[2, 2], 1 - r[0, 0] + r[1, 1] - r[2, 2],
               1 - r[0, 0] - r[1, 1] + r[2, 2], 1 + r[0, 0] + r[1, 1] + r[2, 2]]
    rows = [
        [squares[0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
        [r[0, 1] + r[1, 0], squares[1], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
        [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[2], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], squares[3]],
    ]
    best = np.array(rows[int(np.argmax(squares))])
    x, y, z, w = best / np.linalg.norm(best)
    return kind("geometry_msgs/msg/Quaternion")(x=float(x), y=float(y), z=float(z), w=float(w))


def transforms(time_s, parent, child, pose):
    transform = kind("geometry_msgs/msg/Transform")(
        translation=vector("Vector3", pose[:3, 3]), rotation=quaternion(pose[:3, :3]))
    stamped = kind("geometry_msgs/msg/TransformStamped")(
        header=header(time_s, parent), child_frame_id=child, transform=transform)
    return kind("tf2_msgs/msg/TFMessage")(transforms=[stamped])


def odometry(time_s, pose):
    own = kind("geometry_msgs/msg/Pose")(
        position=vector("Point", pose[:3, 3]), orientation=quaternion(pose[:3, :3]))
    still = kind("geometry_msgs/msg/Twist")(linear=vector("Vector3", [0] * 3), angular=vector("Vector3", [0] * 3))
    zeros = np.zeros(36)
    return kind("nav_msgs/msg/Odometry")(
        header=header(time_s, "odom"), child_frame_id="base_link",
        pose=kind("geometry_msgs/msg/PoseWithCovariance")(pose=own, covariance=zeros),
        twist=kind("geometry_msgs/msg/TwistWithCovariance")(twist=still, covariance=zeros))


def camera_info(time_s, size, numbers):
    fx, fy, cx, cy = numbers
    region = kind("sensor_msgs/msg/RegionOfInterest")(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return kind("sensor_msgs/msg/CameraInfo")(
        header=header(time_s, OPTICAL), height=size[1], width=size[0], distortion_model="plumb_bob", d=np.zeros(5),
        k=np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0]), r=np.eye(3).ravel(),
        p=np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1.0, 0]), binning_x=0, binning_y=0, roi=region)


def image(time_s, encoding, pixels):
    data = np.ascontiguousarray(pixels)
    return kind("sensor_msgs/msg/Image")(
        header=header(time_s, OPTICAL), height=data.shape[0], width=data.shape[1], encoding=encoding, is_bigendian=0,
        step=data.strides[0], data=data.view(np.uint8).ravel())


def messages(folder):
    """Yields time, topic and message."""
    recording = json.loads((folder / "recording.json").read_text())
    first_s = recording["frames"][0]["time_s"]
    optical = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    link = np.eye(4)
    link[:3, 3] = [0.12, -0.03, 0.9]
    yield first_s, "/tf_static", transforms(first_s, "base_link", "camera_link", link)
    yield first_s, "/tf_static", transforms(first_s, "camera_link", OPTICAL, optical)
    base_from_camera = link @ optical
    for frame in recording["frames"]:
        time_s = frame["time_s"]
        pose = np.array(frame["world_from_camera"]).reshape(4, 4) @ np.linalg.inv(base_from_camera)
        for topic, size in [("color", recording["color_size"]), ("depth", recording["depth_size"])]:
            info = camera_info(time_s, size, recording[f"{topic}_k"])
            yield time_s, f"/camera/{topic}/camera_info", info
        for time_near_s in (time_s - 0.02, time_s + 0.02):
            yield time_near_s, "/odom", odometry(time_near_s, pose)
        width, height = recording["color_size"]
        color = np.fromfile(folder / frame["color"], np.uint8).reshape(height, width, 3)
        yield time_s, "/camera/color/image_raw", image(time_s, "rgb8", color)
        width, height = recording["depth_size"]
        depth = np.fromfile(folder / frame["depth"], "<u2").reshape(height, width)
        yield time_s, "/camera/depth/image_raw", image(time_s, "16UC1", depth)


def by_rosbags(folder, plugin):
    with Writer(folder / f"rosbags_{plugin.name.lower()}", version=9, storage_plugin=plugin) as writer:
        connections = {}
        for time_s, topic, message in messages(folder):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=STORE)
            data = STORE.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], int(time_s * 1e9), data)


def plain(value):
    """Returns a message without rosbags' and NumPy's types."""
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype == np.uint8 else value.tolist()
    if isinstance(value, list):
        return [plain(one) for one in value]
    fields = [name for name in getattr(value, "__dataclass_fields__", {}) if name != "__msgtype__"]
    return {name: plain(getattr(value, name)) for name in fields} if fields else value


def by_mcap(folder, compression):
    with open(folder / f"{compression.name.lower()}.mcap", "wb") as stream:
        # Small chunks: the recording is in several.
        writer = McapWriter(stream, chunk_size=20_000, compression=compression)
        schemas = {}
        for time_s, topic, message in messages(folder):
            name = message.__msgtype__
            if name not in schemas:
                schemas[name] = writer.register_msgdef(name, STORE.generate_msgdef(name, ros_version=2)[0])
            writer.write_message(topic, schemas[name], plain(message), log_time=int(time_s * 1e9))
        writer.finish()


def main():
    folder = Path(sys.argv[1])
    for plugin in StoragePlugin:
        by_rosbags(folder, plugin)
    for compression in (CompressionType.ZSTD, CompressionType.LZ4):
        by_mcap(folder, compression)


main()
