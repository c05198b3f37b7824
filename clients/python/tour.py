"""A home from its map to its clip's pose, by the generated client: `python tour.py BASE MAP CLIP [KEY]`."""

import json
import sys
import time
import uuid

from connect import connect
from viola_client.api.changes import list_changes
from viola_client.api.clips import add_clip, get_clip, get_clip_recording, patch_clip
from viola_client.api.homes import get_home, list_homes, put_home
from viola_client.api.lidar_map import put_lidar_map
from viola_client.models import ClipPatch, ClipState, HomeBody, LidarMapDryRun, Problem, ProblemType
from viola_client.types import File

base, lidar, clip, *key = sys.argv[1:]
api = connect(base, *key)
home = "python"
# A clip needs seconds to minutes; a service without a worker never aligns it.
DEADLINE_S = 600


def accepted(answer):
    """The answer, if it is no refusal."""
    assert not isinstance(answer, Problem), answer
    assert answer is not None
    return answer


accepted(put_home.sync(home, client=api, body=HomeBody(name="Elm Street")))
with open(lidar, "rb") as file:
    report = accepted(put_lidar_map.sync(home, client=api, body=File(file), dry_run=True))
assert isinstance(report, LidarMapDryRun), report
with open(lidar, "rb") as file:
    assert accepted(put_lidar_map.sync(home, client=api, body=File(file))).revision == 1

# One key for each recording: a retry with it makes no second clip.
recording_key = str(uuid.uuid4())
with open(clip, "rb") as file:
    body = File(file)
    added = accepted(add_clip.sync(home, client=api, body=body, filename="tour.zip", idempotency_key=recording_key))
now = added
begun_s = time.monotonic()
while now.state in (ClipState.QUEUED, ClipState.ALIGNING):
    if time.monotonic() - begun_s > DEADLINE_S:
        raise TimeoutError(f"the clip is still {now.state.value} after {DEADLINE_S} s")
    time.sleep(0.1)
    now = accepted(get_clip.sync(home, added.id, client=api))
assert accepted(patch_clip.sync(home, added.id, client=api, body=ClipPatch(title="Kitchen"))).title == "Kitchen"
recording = accepted(get_clip_recording.sync(home, added.id, client=api)).payload.read()
with open(clip, "rb") as file:
    assert recording == file.read()

homes = accepted(list_homes.sync(client=api, q="PYTHON"))
assert home in [one.id for one in homes.items]
# The feed comes in pages, the oldest first.
page = accepted(list_changes.sync(client=api))
is_told = False
while True:
    is_told = is_told or any(str(change.clip) == str(added.id) for change in page.items)
    if not page.more:
        break
    page = accepted(list_changes.sync(client=api, after=page.next_))
assert is_told

# A refusal has a type that programs can tell apart.
nowhere = get_home.sync("nowhere", client=api)
assert isinstance(nowhere, Problem) and nowhere.type_ == ProblemType.URNVIOLAPROBLEMHOME_NOT_FOUND, nowhere
# A clip whose file cannot be read has no answer.
pose = now.alignment.map_from_clip.to_dict() if now.alignment else None
print(json.dumps({"state": now.state.value, "map_from_clip": pose}))
