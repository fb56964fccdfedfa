"""Files that a job leaves behind: all of them or none.

They are written into a folder beside their place and moved there when the job is done; a job that fails
leaves nothing new.
"""

from __future__ import annotations

import csv
import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from mrdamper.errors import InputError

__all__ = ["staged", "write_json", "write_table"]


@contextmanager
def staged(out: Path) -> Iterator[Path]:
    """Give a folder to write into; on success its files are moved into ``out``, else it vanishes.

    Raises
    ------
    InputError
        ``out`` is a file, or cannot be written to.
    """
    place = out.absolute()
    standing = next(folder for folder in (place, *place.parents) if folder.exists())
    if not standing.is_dir():
        raise InputError(f"{out}: {standing} is a file; expected a folder to write to. Choose another --out")
    try:
        beside = Path(tempfile.mkdtemp(prefix=".mrdamper-", dir=standing))
    except OSError as fault:
        raise InputError(f"{out}: cannot write there: {fault.strerror}; choose another folder") from fault
    try:
        yield beside
        try:
            for path in sorted(beside.rglob("*")):
                target = place / path.relative_to(beside)
                if path.is_dir():
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                path.replace(target)
        except OSError as fault:
            raise InputError(f"{out}: cannot write there: {fault.strerror}; choose another folder") from fault
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def write_json(path: Path, value: Mapping[str, object]) -> None:
    """Write one JSON object."""
    path.write_text(json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def write_table(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows as CSV, the keys of the first as header; None is an empty cell."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
