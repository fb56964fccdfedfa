"""Parameters of the virtual damper: presets, files, and invalid values."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrdamper.errors import InputError
from mrdamper.virtual_rig.damper import PRESETS, damper_from_mapping, damper_to_toml, find_preset, read_damper
from mrdamper.virtual_rig.lumped import LUMPED
from tests.oracles.paper_preset import solve_thermal_claims


def test_preset_paper_has_published_force_loss():
    found = solve_thermal_claims()
    for name in ("yield_field_N", "viscous_N", "yield_loss_per_K", "friction_loss_per_K"):
        assert getattr(PRESETS["paper"], name) == pytest.approx(getattr(found, name), rel=2e-6), name


@pytest.mark.parametrize("preset", PRESETS)
def test_virtual_damper_is_read_back_from_toml(preset, tmp_path):
    path = tmp_path / "damper.toml"
    path.write_text(damper_to_toml(PRESETS[preset]), encoding="utf-8")
    assert read_damper(path) == PRESETS[preset]


def test_damper_file_changes_preset():
    own = damper_from_mapping({"preset": "hard", "friction_N": 90})
    assert own == replace(LUMPED["hard"], name="hard-own", friction_N=90.0)
    assert damper_from_mapping({}) == PRESETS["nominal"]
    assert damper_from_mapping({"preset": "stiff", "name": "mine"}).name == "mine"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"friction": 3}, "rig.toml: unknown key 'friction'; did you mean friction_N"),
        ({"preset": "soft"}, "'soft' is not a preset of the virtual rig; "),
        ({"preset": 3}, "3 is not a preset"),
        ({"spread": 0.6}, "spread is 0.6; expected a number, 0 to 0.5"),
        ({"asymmetry": -1.0}, "asymmetry is -1.0; expected a number, -0.9 to 0.9"),
        ({"name": "../mine"}, "name is '../mine'; expected letters"),
    ],
)
def test_invalid_damper_parameter_raises(given, message):
    with pytest.raises(InputError) as error:
        damper_from_mapping(given, "rig.toml")
    assert message in str(error.value)
    assert str(error.value).startswith("rig.toml: ")


def test_unknown_preset_message_names_nearest():
    with pytest.raises(InputError, match=r"'nominel' is not a preset .*; did you mean nominal"):
        find_preset("nominel")
