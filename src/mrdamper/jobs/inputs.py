"""What jobs read: runs in files and folders, files as they are, cards of users' own laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike

from mrdamper.data.channels import ChannelMap
from mrdamper.data.frames import Runs, named_columns, parts_of
from mrdamper.data.proposal.questions import parse_answers
from mrdamper.data.readers import ReadFiles, read_each, read_runs
from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import InputError, UsageError
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.models.python_law import load_python_law


def read_dataset(
    given: Runs,
    channels: str | Path | ChannelMap | None = None,
    *,
    answer: Sequence[str] | None = None,
    flip_force: bool = False,
) -> Dataset:
    """Return the runs in files, folders and frames; runs that are given as themselves are taken as they are.

    Parameters
    ----------
    channels : channel map, for all files; None: the one beside each file, or its headers alone
    answer : answers to questions that files leave open, such as ``force.unit=kN``
    flip_force : turn the sign of the force, for load cells that count compression as positive

    Raises
    ------
    InputError
        A file cannot be read, or there is no run at all.
    """
    parts = parts_of(given)
    if isinstance(given, Dataset):
        dataset = given
    else:
        runs = tuple(each for each in parts if isinstance(each, RigRun))
        dataset = Dataset(runs)
        if len(runs) < len(parts) or not parts:
            paths = [each for each in parts if not isinstance(each, RigRun)]
            read = read_runs(paths, channels, parse_answers(answer or ()))
            dataset = replace(read, runs=(*runs, *read))
    if not len(dataset):
        raise InputError("no runs found", place=", ".join(map(str, parts)), expected="files such as run.csv")
    if flip_force:
        dataset = replace(dataset, runs=tuple(replace(run, force=-run.force) for run in dataset))
    return dataset


def read(
    runs: Runs | None = None,
    columns: Mapping[str, str | float | ArrayLike] | None = None,
    *,
    channels: str | Path | None = None,
    answer: Sequence[str] = (),
    flip_force: bool = False,
) -> Dataset:
    """Return the runs in files, folders, frames and arrays.

    Parameters
    ----------
    runs : paths, frames, runs or several of them; a mapping names its frames; None: ``columns`` are the run
    columns : for each quantity with its unit (``force_kN``) the name of a column, the column itself, or one
        number for the whole run; ``rate_Hz`` if there is no time
    channels : channel map (TOML) for files; None: the file next to each file of measurements
    answer : answers to questions about files, such as ``force.unit=kN``
    flip_force : reverse the sign of the force, for load cells with positive compression

    Raises
    ------
    InputError
        A column is missing, has no unit, is not finite or has a different length; or time does not increase.
    """
    runs, named = named_columns(runs, columns or {})
    if channels is not None and named is not None:
        raise UsageError("channels and columns exclude each other", remedy="Use one of them")
    return read_dataset([] if runs is None else runs, channels or named, answer=answer, flip_force=flip_force)


def read_files(
    given: Runs, channels: Path | ChannelMap | None = None, *, answer: Sequence[str] | None = None
) -> ReadFiles:
    """Return what files and folders hold, whether or not it can be used.

    Raises
    ------
    InputError
        No file could be read, and none leaves a question open; or a path is not there.
    """
    parts = parts_of(given)
    runs = tuple(each for each in parts if isinstance(each, RigRun))
    paths = [each for each in parts if not isinstance(each, RigRun)]
    if runs and not paths:
        return ReadFiles((), (), runs)
    read = read_each(paths, channels, parse_answers(answer or ()))
    if not (read.files or runs or read.questions):
        raise read.fault() or InputError("no runs given", expected="files such as run.csv")
    return replace(read, runs=(*runs, *read.runs))


def read_card_of_law(path: str | Path, law: str | None = None) -> ModelCard:
    """Return a card, which may have been identified with a user's own law.

    Parameters
    ----------
    law : ``file.py:Class`` of that law, which is run; a card of one of our laws does not need it

    Raises
    ------
    InputError
        The card or the law cannot be read.
    """
    if law is None:
        return read_card(path)
    own = load_python_law(law)
    try:
        return read_card(path)
    except InputError:  # it was identified with the user's own law
        return read_card(path, python_law=own)
