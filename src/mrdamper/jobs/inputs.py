"""What a job reads: the runs in files and folders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mrdamper.data.readers import read_runs
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError

__all__ = ["read_dataset"]


def read_dataset(paths: Sequence[str | Path], channels: Path | None, *, flip_force: bool = False) -> Dataset:
    """Read the runs in files and folders; refuse when there is none."""
    dataset = read_runs(list(paths), channels)
    if not len(dataset):
        raise InputError(f"{', '.join(map(str, paths))}: no runs found; expected files such as run.csv")
    if flip_force:
        dataset = Dataset(tuple(replace(run, force=-run.force) for run in dataset))
    return dataset
