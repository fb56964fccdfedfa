"""Entries of a channel map are applied, and an invalid channel map gives a message."""

import numpy as np
import pytest

from mrdamper.data.channels import Channel, ChannelMap, Segments
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("force_N", ("force", "N")),
        ("velocity_m_s", ("velocity", "m_s")),
        ("Force (N)", ("force", "N")),
        ("Displacement [mm]", ("displacement", "mm")),
        (" Current [A] ", ("current", "A")),
        ("t", ("time", "")),
        ("位移（mm）", ("displacement", "mm")),
        ("力(N)", ("force", "N")),
        ("전류(A)", ("current", "A")),
        ("Force (filtered) [kN]", ("force", "kN")),
        ("Force, N", ("force", "N")),
        ("Weg in mm", ("displacement", "mm")),
        ("F_N", ("force", "N")),
        ("T / °C", ("temperature", "°C")),
        ("U, V", ("voltage", "V")),
        ("force_A", ("force", "")),
        ("Force (Trigger)", ("force", "")),
        ("force_N_2", ("force", "N")),
        ("force_V", ("force", "V")),
        ("F (mm)", None),
        ("T (N)", None),
        ("I_max", None),
        ("Force, filtered", None),
        ("压力(MPa)", None),
        ("filtered_force_N", None),
    ],
)
def test_column_header_gives_role_and_unit(header, said):
    assert parse_header(header) == said


def test_gain_converts_file_unit_to_si():
    volts = np.array([0.0, 1.0, -0.5])
    cell = Channel("force", name="CHANNEL1", unit="V", gain=980.665, offset=10.0)
    assert cell.to_si(volts, "", "f") == pytest.approx([10.0, 990.665, -480.3325])
    turned = Channel("force", name="CHANNEL1", unit="V", gain=980.665, offset=10.0, sign=-1)
    assert turned.to_si(volts, "", "f") == pytest.approx([-10.0, -990.665, 480.3325])


def test_unit_converts_to_si():
    millimetres = np.array([0.0, 10.0])
    assert Channel("displacement", unit="mm").to_si(millimetres, "", "f") == pytest.approx([0.0, 0.010])
    shifted = Channel("displacement", unit="mm", offset=0.002, sign=-1)
    assert shifted.to_si(millimetres, "", "f") == pytest.approx([-0.002, -0.012])
    assert Channel("displacement").to_si(millimetres, "mm", "f") == pytest.approx([0.0, 0.010])
    assert Channel("force", unit="N", offset=1.0).to_si(millimetres, "", "f") == pytest.approx([1.0, 11.0])


def test_name_pattern_or_index_selects_column():
    names = ["Time", "Axial Load", "LVDT"]
    assert Channel("force", name="Axial Load").find(names, "f") == 1
    assert Channel("force", pattern="*Load*").find(names, "f") == 1
    assert Channel("force", index=2).find(names, "f") == 1
    assert Channel("force", unit="N").find(names, "f") is None


def test_complete_channel_map_is_read():
    text = """
        [channel.force]
        name = "CHANNEL1"
        unit = "V"
        gain = 980.665
        [constant]
        voltage_mV = 3212
        temperature_degC = 25
        [segments]
        split = "Resume"
        current_A = [0, 0.25]
        [session]
        name = "13 May"
    """
    import tomllib

    found = ChannelMap.from_dict(tomllib.loads(text))
    assert found.channels["force"] == Channel("force", name="CHANNEL1", unit="V", gain=980.665)
    assert found.constant == pytest.approx({"voltage": 3.212, "temperature": 298.15})
    assert found.segments == Segments(split="Resume", current_A=(0.0, 0.25))
    assert found.session == "13 May"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"chanel": {}}, "map: unknown key 'chanel'; did you mean channel"),
        (
            {"channel": {"force": {"units": "N"}}},
            "channel.force has no key 'units'; did you mean unit",
        ),
        (
            {"channel": {"force": {"gain": 0.0}}},
            "channel.force: gain is 0.0; expected a finite number, not zero",
        ),
        ({"channel": {"force": {"index": 1, "name": "F"}}}, "name and index are given; give one of them"),
        ({"constant": {"voltage": 3.2}}, "constant has no key 'voltage'; did you mean voltage_V"),
        (
            {"segments": {"split": "Resume"}},
            "segments: the tests of the file are not defined; expected .* one list, current_A or voltage_V",
        ),
    ],
)
def test_invalid_channel_map_is_rejected(given, message):
    with pytest.raises(InputError, match=message):
        ChannelMap.from_dict(given, "map")
