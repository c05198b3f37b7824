"""The recording, by the reader of MCAP and with the schemas that Foxglove publishes."""

import importlib
import math

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from truth import same_points

# The colour of points that no picture showed; in PLY they are black.
GREY = 150
KINDS = {1: "u1", 3: "<u2", 7: "<f4"}

# Half of the last decimal of a document's numbers (src/api/digits.rs).
DIGIT = 0.5e-4 + 1e-9


def packed(message, stride):
    """Returns packed elements as an array with named fields."""
    kinds = {field.name: (KINDS[field.type], field.offset) for field in message.fields}
    layout = {
        "names": list(kinds), "formats": [kind for kind, _ in kinds.values()],
        "offsets": [at for _, at in kinds.values()], "itemsize": stride,
    }
    return np.frombuffer(message.data, np.dtype(layout))


def matches_foxglove(message):
    """Fails unless each message of a file's schema is that of Foxglove: fields, numbers and types."""
    seen, todo = set(), [message.DESCRIPTOR]
    while todo:
        own = todo.pop()
        if own.full_name in seen:
            continue
        seen.add(own.full_name)
        if own.full_name.startswith("google."):
            name = own.full_name.split(".")[-1]
            module = importlib.import_module(f"google.protobuf.{name.lower()}_pb2")
        else:
            name = own.full_name.split(".")[1]
            module = importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2")
        theirs = getattr(module, name).DESCRIPTOR
        fields = lambda of: [
            (f.number, f.name, f.type, f.is_repeated, f.message_type and f.message_type.full_name) for f in of.fields
        ]
        assert fields(own) == fields(theirs), own.full_name
        enums = lambda of: {e.name: [(v.name, v.number) for v in e.values] for e in of.enum_types}
        assert enums(own) == enums(theirs), own.full_name
        todo += [field.message_type for field in own.fields if field.message_type]
    return len(seen)


def mcap(truth):
    messages = {}
    with open(truth.path("home.mcap"), "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert channel.topic not in messages, channel.topic
            messages[channel.topic] = decoded
            assert decoded.DESCRIPTOR.full_name == schema.name
        notes = [record.metadata for record in reader.iter_metadata()]
    assert summary.statistics.message_count == len(messages) == len(summary.channels)
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) > 0
    checked = sum(matches_foxglove(message) for message in messages.values())
    assert checked > 20
    assert notes[0]["level"] == truth.level and int(notes[0]["points"]) == len(truth.vertices)
    points(truth, messages)
    objects(truth, messages["/objects"])
    clips(truth, messages)
    grid(truth, messages["/lidar_map"])
    return f"{len(messages)} topics"


def points(truth, messages):
    parts = sorted((topic for topic in messages if topic.startswith("/map/points")), key=lambda name: (len(name), name))
    clouds = [packed(messages[topic], messages[topic].point_stride) for topic in parts]
    cloud = np.concatenate(clouds)
    assert all(messages[topic].frame_id == "map" for topic in parts)
    for name in ["x", "y", "z", "label", "probability", "clip"]:
        assert (cloud[name] == truth.vertices[name]).all(), name
    colors, own = (np.stack([points[name] for name in ["red", "green", "blue"]], axis=1) for points in (cloud, truth.vertices))
    assert (colors == np.where(own.any(axis=1, keepdims=True), own, GREY)).all()
    truth.is_the_room(truth.positions(cloud))


def objects(truth, scene):
    assert sorted(entity.id for entity in scene.entities) == sorted(thing["id"] for thing in truth.objects)
    for entity in scene.entities:
        thing = next(thing for thing in truth.objects if thing["id"] == entity.id)
        assert {pair.key: pair.value for pair in entity.metadata}["class"] == thing["class"]
        [cube], [text] = entity.cubes, entity.texts
        assert text.text == (thing["name"] or thing["id"])
        at, size, turn = cube.pose.position, cube.size, cube.pose.orientation
        same_points([[at.x, at.y, at.z]], [thing["centre_m"]], DIGIT)
        same_points([[size.x, size.y, size.z]], [thing["size_m"]], DIGIT)
        assert abs(2 * math.atan2(turn.z, turn.w) - thing["yaw_rad"]) < DIGIT


def clips(truth, messages):
    transforms = {t.child_frame_id: t for t in messages["/tf"].transforms}
    assert len(transforms) == len(truth.clips)
    for clip in truth.clips:
        pose, transform = clip["map_from_clip"], transforms[f"clip/{clip['clip']}"]
        assert transform.parent_frame_id == "map"
        assert abs(transform.translation.x - pose["x_m"]) < DIGIT and abs(transform.translation.y - pose["y_m"]) < DIGIT
        path = messages[f"/clips/{clip['clip']}/path"]
        assert path.frame_id == "map" and 0 < len(path.poses) <= 500
        if not truth.room:
            continue
        at = truth.in_room([[p.position.x, p.position.y, p.position.z] for p in path.poses])
        # The camera went round a circle of 0.4 m about the middle of the room.
        x, y = truth.room["camera_circle"]["centre_m"]
        radius = np.hypot(at[:, 0] - x, at[:, 1] - y)
        assert np.abs(radius - truth.room["camera_circle"]["radius_m"]).max() < 0.1, radius
        assert np.abs(at[:, 2] - truth.room["camera_circle"]["height_m"]).max() < 0.1, at[:, 2]


def grid(truth, message):
    cells = packed(message, message.cell_stride)
    assert message.row_stride == message.column_count * message.cell_stride
    places = np.flatnonzero(cells["occupancy"] == 100)
    assert (cells["alpha"][places] == 255).all()
    x = (places % message.column_count + 0.5) * message.cell_size.x + message.pose.position.x
    y = (places // message.column_count + 0.5) * message.cell_size.y + message.pose.position.y
    assert len(x) > 0
    if not truth.room:
        return
    at = truth.in_room(np.column_stack([x, y, np.zeros(len(x))]))
    length, width, _ = truth.room["size_m"]
    tolerance_m = message.cell_size.x
    same_points([at.min(axis=0)[:2], at.max(axis=0)[:2]], [[0, 0], [length, width]], tolerance_m)
