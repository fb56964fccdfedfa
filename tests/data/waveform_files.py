"""FAMOS and catman files, written byte by byte as their layouts say (``formats.waveforms``)."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

__all__ = ["FAMOS_CODES", "catman_file", "famos_channel", "famos_key"]

FAMOS_CODES: Mapping[int, str] = {
    1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8", 11: "<u2"
}  # fmt: skip


def famos_key(name: str, *parameters: object, version: int = 1) -> bytes:
    """Return a key with its length; texts are in Windows-1252."""
    parts = [each if isinstance(each, bytes) else str(each).encode("cp1252") for each in parameters]
    content = b",".join(parts)
    return b"|%s,%d,%d,%s;" % (name.encode(), version, len(content), content)


def famos_component(
    index: int,
    raw: np.ndarray,
    code: int,
    *,
    unit: str,
    scale: tuple[float, float] | None = None,
    start: float = 0.0,
    ahead: int = 0,
    said: Mapping[str, Mapping[int, object]] | None = None,
) -> tuple[bytes, bytes]:
    """Return the keys of a component, and the one of its samples, ``ahead`` bytes into their buffer.

    ``said`` puts parameters by place in keys, in place of true ones.
    """
    data = raw.astype(FAMOS_CODES[code]).tobytes()
    size, held = len(data) // max(len(raw), 1), len(data)
    factor, offset = scale or (1.0, 0.0)
    keys: dict[str, list[object]] = {
        "CC": [1, 1],
        "CP": [1, size, code, 8 * size, 0, 0, 1, 0],
        "Cb": [1, 0, 1, index, ahead, held, 0, held, 0, start, 0],
        "CR": [int(scale is not None), factor, offset, 1, len(unit), unit],
    }
    for key, places in (said or {}).items():
        for place, value in places.items():
            keys[key][place] = value
    head = b"".join(famos_key(name, *parameters) for name, parameters in keys.items())
    return head, famos_key("CS", index, b"\xaa" * ahead + data + b"\xbb" * 3)


def famos_channel(
    index: int,
    name: str | bytes,
    raw: np.ndarray,
    code: int,
    *,
    step: Sequence[object] = (0.005, 1, 1, "s", 0, 0, 0),
    unit: str = "N",
    over: tuple[np.ndarray, str] | None = None,
    kind: int = 1,
    **how: Any,
) -> bytes:
    """Return a channel at even steps, or ``over`` an abscissa of its own with its unit."""
    keys, samples = famos_component(index, raw, code, unit=unit, **how)
    if over is not None:
        more, others = famos_component(index + 100, over[0], 8, unit=over[1])
        keys, samples = keys + more, samples + others
    named = famos_key("CN", 0, 0, 0, len(name), name, 0, "")
    return famos_key("CG", 1, kind, 1) + famos_key("CD", *step) + keys + named + samples


def text(word: str | bytes, form: str = "<h") -> bytes:
    """Return a text of a catman file behind its length."""
    data = word if isinstance(word, bytes) else word.encode()
    return struct.pack(form, len(data)) + data


def catman_file(
    channels: Sequence[tuple[str | bytes, str, np.ndarray, int]],
    comment: str = "",
    *,
    identity: int = 5012,
    kind: int = 0,
    extended: int = 148,
    points: int = 0,
) -> bytes:
    """Return a catman file of channels, each its name, unit, samples and their form.

    ``kind`` is that of all channels, ``extended`` the length of their further headers, ``points`` those of
    their linearisation.
    """
    head, data = b"", b""
    for number, (name, unit, values, form) in enumerate(channels, start=1):
        further = (bytes(140) + struct.pack("<b7x", form))[:extended]
        head += struct.pack("<hi", number, len(values)) + text(name) + text(unit) + text("remark")
        head += struct.pack("<hhdi", kind, 8, 0.0, len(further)) + further
        head += b"00" + struct.pack("<b", points) + bytes(8 * points) + struct.pack("<h", 0)
        head += text("formula") + text("information", "<i")
        if form == 2 and len(values):
            low, high = values.min(), values.max()
            steps = np.round((values - low) / (high - low) * 32767.0).astype("<u2")
            data += struct.pack("<2d", low, high) + steps.tobytes()
        else:
            data += np.asarray(values, {0: "<f8", 1: "<f4"}.get(form, "<f8")).tobytes()
    above = text(comment) + 32 * text("") + struct.pack("<hi", len(channels), 0)
    above += bytes(4 * len(channels)) + bytes(4)
    return struct.pack("<hi", identity, 6 + len(above) + len(head)) + above + head + data
