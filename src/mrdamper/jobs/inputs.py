"""Read runs from files, folders and data frames, and cards with user-defined laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from numpy.typing import ArrayLike

from mrdamper.data.channels import ChannelMap
from mrdamper.data.frames import Runs, columns_by_name, parts_of
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
    """Return a data set with the runs in files, folders and data frames.

    Parameters
    ----------
    channels : channel map for all files; None: the map next to each file, or its headers if there is no map
    answer : answers to open questions about files, such as ``force.unit=kN``
    flip_force : True: reverse the sign of the force, for load cells with positive compression

    Raises
    ------
    InputError
        If a file is not readable or there are no runs.
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
    """Return the runs in files, folders, data frames and arrays.

    Parameters
    ----------
    runs : path, data frame, run, or a list of such objects; or a dictionary with a data frame for each name
        of a run; None: ``columns`` contains the data of one run
    columns : the key is a quantity with its unit (``force_kN``). The value is the name of a column, an array,
        or one number for the whole run. ``rate_Hz`` is required if no column is the time
    channels : channel map (TOML) for files; None: the map next to each file of measurements
    answer : answers to questions about files, such as ``force.unit=kN``
    flip_force : True: reverse the sign of the force, for load cells with positive compression

    Raises
    ------
    InputError
        If a column is missing, has no unit, is not finite or has a different length, or if time does not
        increase.
    """
    runs, named = columns_by_name(runs, columns or {})
    if channels is not None and named is not None:
        raise UsageError("channels and columns exclude each other", remedy="Use one of them")
    return read_dataset([] if runs is None else runs, channels or named, answer=answer, flip_force=flip_force)


def read_files(
    given: Runs, channels: Path | ChannelMap | None = None, *, answer: Sequence[str] | None = None
) -> ReadFiles:
    """Return the content of all files, including files that are not readable or have open questions.

    Raises
    ------
    InputError
        If a path does not exist, or if no file is readable and no file has an open question.
    """
    parts = parts_of(given)
    runs = tuple(each for each in parts if isinstance(each, RigRun))
    paths = [each for each in parts if not isinstance(each, RigRun)]
    if runs and not paths:
        return ReadFiles((), (), runs)
    read = read_each(paths, channels, parse_answers(answer or ()))
    if not (read.files or runs or any(file.questions for file in read.unreadable)):
        raise read.fault() or InputError("no runs given", expected="files such as run.csv")
    return replace(read, runs=(*runs, *read.runs))


def read_card_of_law(path: str | Path, law: str | None = None) -> ModelCard:
    """Return the model card in a file. A card with a user-defined law can be read only with this law.

    Parameters
    ----------
    law : ``file.py:Class`` of the user-defined law, whose file is executed; None: the card has a built-in law

    Raises
    ------
    InputError
        If the card or the law is not readable.
    """
    if law is None:
        return read_card(path)
    own = load_python_law(law)
    try:
        return read_card(path)
    except InputError:  # The card has a user-defined law.
        return read_card(path, python_law=own)
