"""Binary files of channels that each have a time: what was written comes back, sample by sample."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mrdamper.data.formats.waveforms.catman import is_catman, read_catman
from mrdamper.data.formats.waveforms.famos import read_famos

from mrdamper.data.formats.table import FileOptions
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError
from tests.data.waveform_files import FAMOS_CODES, catman_file, famos_channel, famos_key

HEAD = famos_key("CF", 1, version=2) + famos_key("CK", 1)
RAW = np.array([0, 1, 5, 100, 127])
TIME = np.array([0.0, 0.25, 0.5, 1.0, 4.0])
FORCE = np.array([-300.0, 0.1, 2.5, 1e-7, 900.0])


@pytest.fixture
def file(tmp_path):
    """Return a function that writes bytes to a file."""

    def write(content):
        (tmp_path / "run").write_bytes(content)
        return tmp_path / "run"

    return write


def cut_everywhere(content, file):
    """Assert that a file is refused wherever it is cut; return what it holds when it is whole."""
    for size in {*range(0, len(content), 5), *range(len(content) - 20, len(content))}:
        with pytest.raises(InputError):
            read_table(file(content[:size]))
    return read_table(file(content))


# ------------------------------------------------------------------------------------------- FAMOS


@given(
    code=st.sampled_from(sorted(FAMOS_CODES)),
    scale=st.none() | st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
    start=st.floats(-10.0, 10.0),
    step=st.floats(1e-4, 1.0),
    ahead=st.integers(0, 9),
)
def test_a_famos_channel_is_its_raw_samples_scaled_at_its_steps(
    tmp_path_factory, code, scale, start, step, ahead
):
    kind = np.dtype(FAMOS_CODES[code])
    ends = np.iinfo(kind) if kind.kind in "iu" else np.finfo(kind)
    raw = np.array([ends.min, 0, 1, 7, ends.max / 4 if kind.kind == "f" else ends.max]).astype(kind)
    path = tmp_path_factory.mktemp("famos") / "run.raw"
    given_step = (repr(step), 1, 2, "ms", 0, 0, 0)
    path.write_bytes(
        HEAD + famos_channel(1, "Kraft", raw, code, step=given_step, scale=scale, start=start, ahead=ahead)
    )
    table = read_famos(path, FileOptions())
    factor, offset = scale or (1.0, 0.0)
    with np.errstate(over="ignore"):
        expected = raw.astype(np.float64) * factor + offset
    assert np.array_equal(table.columns["Kraft"], expected)
    assert np.array_equal(table.columns["time"], start + step * np.arange(5.0))
    assert dict(table.units) == {"time": "ms", "Kraft": "N"}


def test_famos_channels_keep_their_clocks_names_units_and_words(file):
    over = (TIME, "ms")
    content = HEAD + famos_key("NL", 1251, 7) + famos_key("CT", 1, 4, "Prüf", 8, "A, b; c!")
    content += famos_channel(1, "Сила, 1".encode("cp1251"), RAW, 2, unit="kN")
    content += famos_channel(2, "XY", RAW, 3, unit="mm", over=over, kind=2)
    content += famos_channel(3, "same", -RAW, 4, unit="")
    content += famos_channel(4, "XY", 2 * RAW, 5, over=over, kind=3)  # of the next recording
    table = read_famos(file(content), FileOptions())
    assert table.names == ("time", "Сила, 1", "time (2)", "XY", "same")
    assert dict(table.clocks) == {"time": 0, "Сила, 1": 0, "time (2)": 1, "XY": 1, "same": 0}
    assert dict(table.units) == {"time": "s", "Сила, 1": "kN", "time (2)": "ms", "XY": "mm"}
    assert np.array_equal(table.columns["time (2)"], TIME)
    assert np.array_equal(table.columns["same"], -RAW)
    assert table.said == ("Prьf: A, b; c!",)  # as its code page has it
    (following,) = table.following
    assert np.array_equal(following.columns["XY"], 2 * RAW)
    assert table.rows == following.rows == 5
    short = famos_channel(1, "F", RAW, 2, step=(0.005, 1, "", "ms", 0, 0, 0))  # no length beside the unit
    assert read_famos(file(HEAD + short), FileOptions()).units["time"] == "ms"
    odd = HEAD + famos_key("NL", 7, 7) + famos_channel(1, "Gehäuse", RAW, 2)
    assert "Gehäuse" in read_famos(file(odd), FileOptions()).names  # no such page: Windows'


@pytest.mark.parametrize(
    ("said", "found"),
    [
        ({"Cb": {0: 2}}, "'F' was recorded in several buffers"),
        ({"Cb": {6: 4}}, "'F' is in a ring buffer"),
        ({"Cb": {7: 21}}, None),  # as many as it holds
        ({"Cb": {5: 24, 7: 24}}, "'F' was cut off"),
        ({"Cb": {3: 9}}, "'F' was cut off"),  # a buffer that is not there
        ({"Cb": {7: "x"}}, "a damaged FAMOS file"),
        ({"CP": {2: 13}}, r"'F' holds no plain numbers \(type 13\)"),
        ({"CP": {1: 5}}, "the samples of 'F' are interleaved"),
        ({"CP": {3: 31}}, "the samples of 'F' are interleaved"),
        ({"CP": {5: 1}}, "the samples of 'F' are interleaved"),
        ({"CP": {7: 8}}, "the samples of 'F' are interleaved"),
        ({"CP": {7: 4}}, None),  # one sample after the other
        ({"CR": {1: 2.0}}, "'F' states a factor and that it has none"),
        ({"CR": {2: 1.0}}, "'F' states a factor and that it has none"),
        ({"CR": {1: 0.0}}, None),
    ],
)
def test_a_famos_channel_that_is_not_plain_is_refused_with_its_name(file, said, found):
    path = file(HEAD + famos_channel(1, "F", RAW, 6, said=said))
    if found is None:
        assert np.array_equal(read_famos(path, FileOptions()).columns["F"], RAW)
        return
    with pytest.raises(InputError, match=found) as refused:
        read_famos(path, FileOptions())
    assert refused.value.place == str(path)
    assert "Copy it again" in str(refused.value) or "Export the channels as CSV" in str(refused.value)


def test_a_famos_file_of_another_order_kind_or_without_steps_is_refused(file):
    whole = famos_channel(1, "F", RAW, 2)
    named = famos_key("CN", 0, 0, 0, 1, "G", 0, "")
    short = (TIME[:4], "s")
    for content, found in (
        (famos_key("CF", 2, version=2) + whole, "samples in another byte order"),
        (HEAD, "no channels of numbers"),
        (HEAD + famos_channel(1, "F", RAW, 2, kind=2), "'F' is no channel of real numbers"),
        (HEAD + famos_channel(1, "F", RAW, 2, over=(TIME, "s")), "'F' is no channel of real numbers"),
        (HEAD + famos_channel(1, "F", RAW, 2, over=short, kind=2), "'F' was cut off"),
        (HEAD + whole + named, "'F' is no channel of real numbers"),
        (HEAD + famos_channel(1, "F", RAW, 2, step=(0.1, 1, 1)), "'F' states no sampling interval"),
    ):
        with pytest.raises(InputError, match=found):
            read_famos(file(content), FileOptions())


def test_a_famos_file_is_refused_wherever_it_is_cut_and_damage_has_its_byte(file):
    content = HEAD + famos_channel(1, "F", RAW, 6)
    assert np.array_equal(cut_everywhere(content, file).columns["F"], RAW)
    for broken, at in (
        (content.replace(b"|CP,1,", b"|CP,1x", 1), content.index(b"|CP")),
        (content.replace(b";|CN", b":|CN", 1), content.rindex(b"|CR")),
    ):
        with pytest.raises(InputError, match=rf"a damaged FAMOS file \(at byte {at}\)"):
            read_famos(file(broken), FileOptions())


# ------------------------------------------------------------------------------------------- catman


def test_a_catman_file_gives_each_sample_over_the_time_of_its_length(file):
    slow = np.array([0.0, 500.0])
    channels = (
        ("Weg", "mm", FORCE / 7.0, 0),
        ("Zeit", "s", TIME, 0),
        ("Dämpfer".encode("cp1252"), "kN", FORCE, 1),
        ("Temperatur", "°C", np.array([40.0, 40.25, 41.0, 39.0, 43.0]), 2),
        ("Zeit 2", "s", TIME, 0),  # the same once more
        ("gone", "V", np.empty(0), 0),
        ("langsam", "ms", slow, 0),
        ("Strom", "A", np.array([0.5, -0.5]), 0),
    )
    for identity, points in itertools.product((5009, 5029), (0, 3)):
        table = read_table(file(catman_file(channels, "Prüfung 7", identity=identity, points=points)))
        assert table.names == ("time", "Weg", "Dämpfer", "Temperatur", "time (2)", "Strom")
        assert np.array_equal(table.columns["Weg"], FORCE / 7.0)
        assert np.array_equal(table.columns["Dämpfer"], FORCE.astype(np.float32))
        assert np.allclose(table.columns["Temperatur"], channels[3][2], atol=4.0 / 32767.0 / 2.0)
        assert (table.columns["Temperatur"].min(), table.columns["Temperatur"].max()) == (39.0, 43.0)
        assert np.array_equal(table.columns["time"], TIME)
        assert np.array_equal(table.columns["time (2)"], slow)
        assert np.array_equal(table.columns["Strom"], [0.5, -0.5])
        assert dict(table.clocks) == dict(zip(table.names, (0, 0, 0, 0, 1, 1), strict=True))
        assert [table.units[name] for name in table.names] == ["s", "mm", "kN", "°C", "ms", "A"]
        assert (table.said, table.rows) == (("comment: Prüfung 7",), 5)
    assert not is_catman(catman_file(channels, identity=5008)[:512])
    assert not is_catman(catman_file(channels, identity=5030)[:512])


def test_what_a_catman_file_holds_beside_plain_numbers_over_one_time_is_refused(file):
    plain = (("t", "s", TIME, 0), ("F", "N", FORCE, 0))
    for content, found in (
        (catman_file(plain, kind=1), "channel 't' holds no plain numbers"),
        (catman_file(plain, extended=140), "channel 't' holds no plain numbers"),
        (catman_file([plain[0], ("F", "N", FORCE, 3)]), "channel 'F' holds no plain numbers"),
        (catman_file(plain[1:]), r"no channel of time beside channels of 5 samples \('F'\)"),
        (catman_file([*plain, ("t2", "ms", FORCE, 0)]), "several times beside channels of 5 samples"),
        (catman_file(plain[:1]), "no channels of numbers"),
        (catman_file([("t", "s", np.empty(0), 0)], kind=2), "no channels of numbers"),
        (catman_file([]), "no channels of numbers"),
    ):
        with pytest.raises(InputError, match=found) as refused:
            read_catman(file(content), FileOptions())
        assert refused.value.place == str(file(content))
    assert read_catman(file(catman_file(plain, extended=141)), FileOptions()).said == ()


def test_a_catman_file_is_refused_wherever_it_is_cut(file):
    content = catman_file([("t", "s", TIME, 0), ("F", "N", FORCE, 2)])
    assert np.array_equal(cut_everywhere(content, file).columns["time"], TIME)
