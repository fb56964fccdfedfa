"""A list of names next to a matrix names the columns of the matrix, in each format that stores both."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from mrdamper.data.readers import read_runs
from tests.data.test_laboratories import RUNS, assert_read
from tests.data.test_unseen_layouts import columns

NAMES = ("time [s]", "stroke [mm]", "force [N]", "current [A]")
WORDS, UNITS = ("t", "stroke", "force", "current"), ("s", "mm", "N", "A")
Writer = Callable[[Path, np.ndarray], None]


def mat_cell(path: Path, matrix: np.ndarray) -> None:
    savemat(path.with_suffix(".mat"), {"data": matrix, "names": np.array(NAMES, dtype=object)})


def mat_characters(path: Path, matrix: np.ndarray) -> None:
    savemat(path.with_suffix(".mat"), {"data": matrix, "labels": np.array(NAMES), "operator": "K."})


def mat_structure(path: Path, matrix: np.ndarray) -> None:
    inside = {"values": matrix.T, "units": np.array(UNITS, dtype=object)}
    savemat(path.with_suffix(".mat"), {"run": inside | {"names": np.array(WORDS, dtype=object)}})


def mat_version_4(path: Path, matrix: np.ndarray) -> None:
    savemat(path.with_suffix(".mat"), {"data": matrix, "names": np.array(NAMES)}, format="4")


def pandas_fixed(path: Path, matrix: np.ndarray) -> None:
    import h5py

    with h5py.File(path.with_suffix(".h5"), "w") as file:
        group = file.create_group("df")
        group["axis0"] = np.array([*NAMES, "ok"], dtype="S")
        group["axis1"] = np.arange(len(matrix))
        group["block0_items"], group["block0_values"] = np.array(NAMES, dtype="S"), matrix
        group["block1_items"] = np.array(["ok"], dtype="S")
        group["block1_values"] = np.ones((len(matrix), 1), dtype=np.int8)


def hdf5_list(path: Path, matrix: np.ndarray) -> None:
    import h5py

    with h5py.File(path.with_suffix(".h5"), "w") as file:
        file["data"] = matrix.T
        file["channel_names"], file["channel_units"] = [*WORDS], [*UNITS]


WRITERS: tuple[Writer, ...] = (
    mat_cell, mat_characters, mat_structure, mat_version_4, pandas_fixed, hdf5_list
)  # fmt: skip


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_matrix_columns_are_named_by_list(tmp_path, write):
    for k, run in enumerate(RUNS):
        write(tmp_path / f"run_{k}", np.column_stack(columns(run)))
    assert_read(read_runs(tmp_path))
