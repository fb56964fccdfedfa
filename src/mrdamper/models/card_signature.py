"""The signature of a card's file: a hash of all that it states but its notes, the excerpt included.

It is taken over the values of the document, so that another layout or another spelling of the same number
leaves it alone. Who changes a card on purpose makes a new one from it in Python, signed when written.
"""

from __future__ import annotations

import hashlib
import json

from mrdamper.errors import InputError
from mrdamper.schema import Json

FIRST_SIGNED = 3  # schema version
_KEY = "content_sha256"
_OUTSIDE = {_KEY, "notes"}


def content_sha256(document: Json) -> str:
    """Return the SHA-256 of a card's document without its notes, ``sha256:`` before it."""
    content = {key: value for key, value in document.items() if key not in _OUTSIDE}
    values = json.loads(json.dumps(content), parse_int=float)  # 1 and 1.0 are one number
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def signed(document: Json) -> Json:
    """Return the document with its own hash."""
    return {**document, _KEY: content_sha256(document)}


def require_signature(document: Json, place: str) -> None:
    """Refuse a document whose content is not what its hash was taken of."""
    stated, found = document.get(_KEY), content_sha256(document)
    if stated != found:
        raise InputError(
            place=place,
            found=f"the content's hash is {found[:19]}..., and content_sha256 states {str(stated)[:19]}...",
            expected="the card as it was written",
            remedy=(
                "It was edited, cut or put together after it was written: take the original, or identify "
                "again. Only notes may be changed by hand"
            ),
        )
