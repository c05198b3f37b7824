"""Point files, by the readers of surveyors and of 3D programs."""

import laspy
import numpy as np
import pye57
import pygltflib
import trimesh
from pye57 import libe57

from truth import same_points, z_up

# The step of the coordinates in LAZ, in metres, and half of it for rounding.
LAZ_STEP_M = 0.001


def laz(truth):
    las = laspy.read(truth.path("points.laz"))
    header = las.header
    assert (str(header.version), header.point_format.id) == ("1.4", 7)
    assert list(header.scales) == [LAZ_STEP_M] * 3 and list(header.offsets) == [0] * 3
    assert header.point_count == len(truth.vertices)
    with pye57.E57(truth.path("points.e57")) as file:
        assert file.image_file.root()["guid"].value() == f"{{{header.uuid}}}", header.uuid
    xyz = np.asarray(las.xyz)
    same_points(xyz, truth.xyz, LAZ_STEP_M / 2 + 1e-6)
    assert (header.mins <= xyz.min(axis=0)).all() and (header.maxs >= xyz.max(axis=0)).all()
    same_points([header.mins, header.maxs], [xyz.min(axis=0), xyz.max(axis=0)], LAZ_STEP_M + 1e-6)
    truth.is_the_room(xyz)
    for channel in ["red", "green", "blue"]:
        assert (np.asarray(las[channel]) == truth.vertices[channel].astype(int) * 256).all(), channel
    own = {0: 1, 1: 2}
    code = np.array([own.get(label, 64 + label) for label in range(256)])
    assert (np.asarray(las.classification) == code[truth.vertices["label"]]).all()
    assert list(las.point_format.extra_dimension_names) == ["probability", "clip"]
    assert (las["probability"] == truth.vertices["probability"]).all()
    assert (las["clip"] == truth.vertices["clip"]).all()
    frames = [vlr for vlr in header.vlrs if vlr.record_id == 2112]
    assert len(frames) == 1 and frames[0].string.startswith("LOCAL_CS["), frames
    return f"{header.point_count} points"


def e57(truth):
    with pye57.E57(truth.path("points.e57")) as file:
        assert file.scan_count == 1
        header = file.get_header(0)
        assert header.point_count == len(truth.vertices)
        assert not header.has_pose()
        scan = file.read_scan(0, colors=True, ignore_missing_fields=True)
        xyz = np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
        same_points(xyz, truth.xyz, 0)
        low = [header.xMinimum, header.yMinimum, header.zMinimum]
        high = [header.xMaximum, header.yMaximum, header.zMaximum]
        same_points([low, high], [xyz.min(axis=0), xyz.max(axis=0)], 1e-6)
        truth.is_the_room(xyz)
        for channel in ["Red", "Green", "Blue"]:
            assert (scan[f"color{channel}"] == truth.vertices[channel.lower()]).all(), channel
        for name, field, kind in [
            ("viola:class", "label", "B"), ("viola:probability", "probability", "f"), ("viola:clip", "clip", "H"),
            ("nor:normalX", "nx", "f"), ("nor:normalY", "ny", "f"), ("nor:normalZ", "nz", "f"),
        ]:
            assert name in header.point_fields, (name, header.point_fields)
            values = np.empty(header.point_count, kind)
            buffers = libe57.VectorSourceDestBuffer()
            buffers.append(libe57.SourceDestBuffer(file.image_file, name, values, header.point_count, True, True))
            header.points.reader(buffers).read()
            assert (values == truth.vertices[field]).all(), name
        return f"{header.point_count} points"


def glb(truth):
    file = pygltflib.GLTF2().load(truth.path("points.glb"))
    assert file.asset.version == "2.0"
    labels, counts = np.unique(truth.vertices["label"], return_counts=True)
    names = {truth.classes[int(label)]: int(count) for label, count in zip(labels, counts)}
    assert sorted(node.name for node in file.nodes) == sorted(names)
    scene = trimesh.load_scene(truth.path("points.glb"))
    total = 0
    for node in file.nodes:
        count = sum(
            file.accessors[primitive.attributes.POSITION].count for primitive in file.meshes[node.mesh].primitives
        )
        assert count == names[node.name], node.name
        total += count
    xyz = np.concatenate([geometry.vertices for geometry in scene.dump()])
    assert len(xyz) == total == len(truth.vertices)
    truth.is_the_room(z_up(xyz))
    return f"{total} points of {len(names)} classes"


def empty_laz(truth):
    las = laspy.read(truth.path("empty.laz"))
    assert las.header.point_count == len(las.x) == 0
    return "no points"


def empty_e57(truth):
    with pye57.E57(truth.path("empty.e57")) as file:
        assert file.get_header(0).point_count == 0
    return "no points"
