"""How a body of tus is put on the wire, and which headers a valid request has."""

import schemathesis
from schemathesis.generation import GenerationMode

CONDITIONS = ("If-Match", "If-None-Match")


@schemathesis.serializer("application/offset+octet-stream")
def octets(context, value):
    return value if isinstance(value, bytes) else str(value).encode()


@schemathesis.hook
def before_call(context, case, kwargs):
    """Takes conditions from valid changes: a made-up entity tag names no state. `tests/api/conditions.rs` has true ones."""
    if case.meta and case.meta.generation.mode == GenerationMode.POSITIVE and case.method.upper() != "GET":
        for name in CONDITIONS:
            case.headers.pop(name, None)
