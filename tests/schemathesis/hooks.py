"""How a body of tus is put on the wire: as it is."""

import schemathesis


@schemathesis.serializer("application/offset+octet-stream")
def octets(context, value):
    return value if isinstance(value, bytes) else str(value).encode()
