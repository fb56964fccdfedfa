"""Octave reads the exported MATLAB folder and gets the values of the card and the forces of the map."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from mrdamper.codegen.matlab import tables_text, write_matlab
from mrdamper.codegen.table import ForceMap, force_map
from mrdamper.quantities import ZERO_CELSIUS_K
from tests.export.exports import card_of
from tests.support.cards import DAMPERS, rig_damper

pytestmark = pytest.mark.system

ASKS = """
damper = mrdamper_load();
asked = dlmread('asked.txt');
forces = [mrdamper_force(damper, asked(:, 3), asked(:, 2), asked(:, 1)), ...
          mrdamper_force(damper, asked(:, 3), asked(:, 2), asked(:, 1), 'rising')];
dlmwrite('forces.txt', forces, 'precision', 17);
dlmwrite('numbers.txt', damper.parameters.value(:), 'precision', 17);
printf('%s|%s|%d\\n', damper.law, damper.command_unit, numel(damper.parameters.name));
"""


def expected(table: ForceMap, values: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return SciPy's linear interpolation of the map. Points outside the map are moved to its edge."""
    along = [table.temperature - ZERO_CELSIUS_K, table.command, table.velocity]
    kept = [k for k, each in enumerate(along) if len(each) > 1]
    grid = RegularGridInterpolator([along[k] for k in kept], values.reshape([len(along[k]) for k in kept]))
    held = [np.clip(asked[:, k], along[k][0], along[k][-1]) for k in kept]
    found: np.ndarray = grid(np.column_stack(held))
    return found


@pytest.mark.parametrize("card", ["of three dimensions", "at one temperature"])
def test_octave_reads_card_and_force_map(card, tmp_path, tool):
    chosen = card_of(rig_damper()) if card == "of three dimensions" else card_of(DAMPERS["bouc-wen"])
    table = force_map(chosen)
    write_matlab(table, tmp_path)
    draw = np.random.default_rng(0)
    asked = np.column_stack(
        [
            draw.uniform(0.0, 150.0, 40),
            draw.uniform(-0.5, 1.2 * table.command[-1] + 0.5, 40),
            1.2 * draw.uniform(table.velocity[0], table.velocity[-1], 40),
        ]
    )
    np.savetxt(tmp_path / "asked.txt", asked)
    (tmp_path / "asks.m").write_text(ASKS, encoding="utf-8")
    run = subprocess.run(
        [tool("octave-cli"), "--no-init-file", "--quiet", "asks.m"],
        cwd=tmp_path, check=False, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == f"{chosen.damper.law.name}|A|{len(chosen.damper.parameters)}"
    forces = np.loadtxt(tmp_path / "forces.txt", delimiter=",")
    np.testing.assert_allclose(forces[:, 0], expected(table, table.pick, asked), rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(forces[:, 1], expected(table, table.rising, asked), rtol=1e-9, atol=1e-6)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "numbers.txt"), [*chosen.damper.parameters.values()])


def test_modelica_table_contains_map_and_breakpoints():
    """The table begins with its name and size. The first row contains commands, the first column speeds."""
    table = force_map(card_of(DAMPERS["bouc-wen"]))
    first, _, head, *rows = tables_text(table).splitlines()
    assert first == "#1"
    assert head == f"double force_20degC({len(table.velocity) + 1},{len(table.command) + 1})"
    numbers = np.array([[float(each) for each in row.split()] for row in rows[: len(table.velocity) + 1]])
    np.testing.assert_allclose(numbers[0, 1:], table.command)
    np.testing.assert_allclose(numbers[1:, 0], table.velocity, rtol=1e-8)
    np.testing.assert_allclose(numbers[1:, 1:].T, table.pick[0], rtol=1e-8)
