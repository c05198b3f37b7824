"""The generated client with what an app needs: timeouts, and one error for answers that are not the service's.

`connect(base, key)` returns the client. A refusal of the service is an answer, a `Problem`. Everything else is an
`UnexpectedStatus` with `status_code` and `content`: the HTML page of a proxy, of whatever status, and an answer without
a body. The generated code alone would fail to parse such a page, and would wait for ever for a server that is silent.
"""

import httpx
from viola_client import AuthenticatedClient, Client
from viola_client.errors import UnexpectedStatus

# The answer to an upload may take three minutes after the last byte: docs/api.md, "Clips".
TIMEOUT = httpx.Timeout(30.0, read=200.0)


def is_page(answer):
    """Whether an answer is no JSON document, file or problem of the service."""
    kind = answer.headers.get("content-type", "").split(";")[0].strip().lower()
    return kind == "text/html" or (answer.status_code >= 400 and kind != "application/problem+json")


def refuse_page(answer):
    if is_page(answer):
        answer.read()
        raise UnexpectedStatus(answer.status_code, answer.content)


async def refuse_page_later(answer):
    if is_page(answer):
        await answer.aread()
        raise UnexpectedStatus(answer.status_code, answer.content)


def connect(base, key=None, timeout=TIMEOUT, for_asyncio=False):
    """The client of the service at `base`; `for_asyncio` if its `asyncio` functions are called, not its `sync` ones."""
    hook = refuse_page_later if for_asyncio else refuse_page
    settings = {
        "base_url": base,
        "timeout": timeout,
        "raise_on_unexpected_status": True,
        "httpx_args": {"event_hooks": {"response": [hook]}},
    }
    return AuthenticatedClient(token=key, **settings) if key else Client(**settings)
