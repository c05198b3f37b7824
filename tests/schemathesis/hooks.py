"""Gives requests what their schemas cannot say: a true cursor, entity tag, file, checksum or offset, and numbers in order.

Only the valid parts of a request are changed. What is invalid on purpose stays, and so do ids, texts and numbers. So
the statuses that Schemathesis expects by itself hold for every operation: none of them has a list of its own.
"""

import base64
import hashlib
import os
import re
from pathlib import Path

import requests
import schemathesis
from schemathesis.core.parameters import ParameterLocation
from schemathesis.generation import GenerationMode

BASE = os.environ["VIOLA_BASE"]
HOME = Path(os.environ["VIOLA_HOME"])
HOME_ID = os.environ["VIOLA_HOME_ID"]
JOB = os.environ["VIOLA_JOB"]
CLIP = (HOME / "small.zip").read_bytes()
MAP = (HOME / "valetudo.json").read_bytes()
RECORDED_AT = "2026-03-14T15:09:26Z"
MAX_PLACE_M = 1000
UNKNOWN = "x-schemathesis-unknown-property"
VERSION = re.compile(r"\d+\.\d+\.\d+", re.ASCII)

session = requests.Session()
session.headers["Authorization"] = f"Bearer {os.environ['VIOLA_KEY']}"


@schemathesis.serializer("application/offset+octet-stream")
def octets(context, value):
    return value if isinstance(value, bytes) else b""


@schemathesis.hook
def before_call(context, case, kwargs):
    parts = case.meta.components if case.meta else {}
    if UNKNOWN in case.headers and ParameterLocation.HEADER in parts:
        # A header more makes no request invalid.
        parts[ParameterLocation.HEADER].mode = GenerationMode.POSITIVE
        if all(part.mode.is_positive for part in parts.values()):
            case.meta.generation.mode = GenerationMode.POSITIVE
    is_all_valid = case.meta is None or case.meta.generation.mode.is_positive
    is_valid = {part: part not in parts or parts[part].mode.is_positive for part in ParameterLocation}
    operation = case.operation.definition.raw["operationId"]
    if operation == "watch_job":
        # A stream ends with its job, and no job runs meanwhile.
        watch_ended(case)
    if VERSION.fullmatch(str(case.headers.get("Tus-Resumable"))):
        case.headers["Tus-Resumable"] = "1.0.0"
    if is_valid[ParameterLocation.QUERY]:
        correct_query(case)
    if is_valid[ParameterLocation.BODY]:
        correct_body(operation, case)
    if not is_valid[ParameterLocation.HEADER] and case.headers.get("X-HTTP-Method-Override") == "DELETE":
        # A deletion uses no other header, so only an upload's part shows that an invalid one is refused.
        case.headers["X-HTTP-Method-Override"] = "PATCH"
    # The coverage phase marks the values of one part as invalid, but the whole request as valid.
    if is_valid[ParameterLocation.HEADER] or is_all_valid:
        correct_conditions(case)
        if case.path.startswith("/v1/uploads"):
            correct_upload(operation, case, is_valid[ParameterLocation.BODY])
        if is_valid[ParameterLocation.BODY]:
            correct_digests(case)
    # Schemathesis would judge changed parts anew, and takes every changed file for an invalid one.
    case._record_starting_state()


def ask(method, path, **more):
    return session.request(method, BASE + path, timeout=30, **more)


def watch_ended(case):
    job = ask("GET", f"/v1/jobs/{case.path_parameters.get('job')}")
    if job.status_code == 200 and job.json()["state"] in ("queued", "running"):
        case.path_parameters["job"] = JOB


def correct_query(case):
    query = case.query or {}
    if "after" in query:
        page = ask("GET", case.formatted_path, params={"limit": 1})
        cursor = page.json().get("next") if page.status_code == 200 else None
        if cursor:
            query["after"] = cursor
        else:
            del query["after"]
    for name, count in (("box", 6), ("z", 2)):
        if name in query:
            query[name] = in_order(query[name], count)
    if "recorded_at" in query:
        query["recorded_at"] = RECORDED_AT
    if case.path.endswith("/map/changes") and "from" in query:
        later = int(query.get("to", 1))
        query["from"] = min(int(query["from"]), later - 1)


def in_order(value, count):
    """A lower corner and an upper one, beside the home at most."""
    numbers = [float(part) for part in (value.split(",") if isinstance(value, str) else value)]
    numbers = [max(-MAX_PLACE_M, min(MAX_PLACE_M, number)) for number in numbers]
    half = count // 2
    pairs = [sorted(pair) for pair in zip(numbers[:half], numbers[half:])]
    ordered = [low for low, _ in pairs] + [high for _, high in pairs]
    return ",".join(map(str, ordered)) if isinstance(value, str) else ordered


def correct_conditions(case):
    """An entity tag is true, or it is not sent. `tests/api/conditions.rs` has those of an old state."""
    if case.method.upper() == "GET":
        case.headers.pop("If-Match", None)
        return
    changed = case.formatted_path.removesuffix("/alignment").split("/revisions/")[0]
    for name in ("If-Match", "If-None-Match"):
        if name in case.headers:
            del case.headers[name]
            now = ask("GET", changed)
            if name == "If-Match" and now.status_code == 200:
                case.headers[name] = now.headers["ETag"]
            elif name == "If-None-Match" and now.status_code == 404:
                case.headers[name] = "*"


def correct_digests(case):
    """A digest is that of the body."""
    body = case.body if isinstance(case.body, bytes) else b""
    for name in ("Content-Digest", "Repr-Digest"):
        if name in case.headers:
            digest = base64.b64encode(hashlib.sha256(body).digest()).decode()
            case.headers[name] = f"sha-256=:{digest}:"


def correct_body(operation, case):
    if operation == "add_clip":
        case.body = CLIP
    elif operation in ("put_lidar_map", "put_level_lidar_map"):
        case.body = MAP
    elif isinstance(case.body, dict):
        {
            "patch_clip": correct_clip,
            "choose_alignment": correct_choice,
            "correct_map_object": correct_object,
            "correct_map_room": correct_room,
            "create_webhook": correct_webhook,
        }.get(operation, lambda body: None)(case.body)


def correct_clip(body):
    """No clip was recorded before the year 2000 or will be after tomorrow."""
    if body.get("recorded_at"):
        body["recorded_at"] = RECORDED_AT


def correct_choice(body):
    """The first alternative exists; a pose lies in the map."""
    if "alternative" in body:
        body["alternative"] = 0
    if "map_from_clip" in body:
        body["map_from_clip"] = {"x_m": 1.0, "y_m": 1.0, "yaw_rad": 0.5}


def correct_object(body):
    if body.get("centre_m"):
        body["centre_m"] = [1.0, 2.0, 0.5]
    if body.get("size_m"):
        body["size_m"] = [2.0, 1.0, 0.5]
    if body.get("yaw_rad"):
        body["yaw_rad"] = 0.5


def correct_room(body):
    """No line is known to divide any room, and no other room to be at its walls."""
    for name in ("split_by", "merge_with"):
        if body.get(name):
            body[name] = None


def correct_webhook(body):
    body["url"] = "https://backend.example/viola"


def correct_upload(operation, case, has_valid_body):
    headers = case.headers
    if operation == "create_upload":
        correct_creation(case, has_valid_body)
    elif operation in ("append_to_upload", "override_method") and headers.get("X-HTTP-Method-Override") != "DELETE":
        correct_part(case, has_valid_body)
    if has_valid_body and "Upload-Checksum" in headers:
        body = case.body if isinstance(case.body, bytes) else b""
        headers["Upload-Checksum"] = "sha1 " + base64.b64encode(hashlib.sha1(body).digest()).decode()


def correct_creation(case, has_valid_body):
    headers = case.headers
    headers["Upload-Metadata"] = "home " + base64.b64encode(HOME_ID.encode()).decode()
    if "Upload-Concat" in headers:
        headers["Upload-Concat"] = "partial"
    if "Upload-Defer-Length" in headers:
        headers.pop("Upload-Length", None)
    else:
        headers["Upload-Length"] = str(len(CLIP))
    if has_valid_body:
        case.body = CLIP[: len(case.body)] if isinstance(case.body, bytes) else b""


def correct_part(case, has_valid_body):
    headers = case.headers
    known = ask("HEAD", case.formatted_path, headers={"Tus-Resumable": "1.0.0"}).headers
    offset = int(known.get("Upload-Offset", 0))
    headers["Upload-Offset"] = str(offset)
    headers.pop("Upload-Length", None)
    if "Upload-Defer-Length" in known:
        headers["Upload-Length"] = str(len(CLIP))
    if has_valid_body:
        count = len(case.body) if isinstance(case.body, bytes) else 0
        case.body = CLIP[offset : offset + max(1, count)]
