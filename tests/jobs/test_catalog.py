"""The catalogue of public data copies and checks files of a local mirror. Nothing is downloaded."""

import hashlib
import io
import re
import urllib.request
from pathlib import Path

import pytest

from mrdamper.errors import InputError
from mrdamper.jobs import public_data
from mrdamper.jobs.public_data import MAPS, DataSet, RemoteFile, fetch, list_sets

CONTENT = b"time_s,force_N\n0,1\n"


@pytest.fixture
def small_set(monkeypatch, tmp_path):
    """Create a mirror with two files and a catalogue entry for them, and return the path of the mirror."""
    mirror = tmp_path / "mirror"
    (mirror / "raw").mkdir(parents=True)
    (mirror / "raw" / "a.csv").write_bytes(CONTENT)
    (mirror / "raw" / "b.csv").write_bytes(CONTENT * 2)
    given = {"a": CONTENT, "b": CONTENT * 2}
    files = tuple(RemoteFile(f"data/{k}.csv", hashlib.sha256(v).hexdigest()) for k, v in given.items())
    chosen = DataSet("small", "", "MIT", "", "owner/name", "0" * 40, "", "", files)
    monkeypatch.setattr(public_data, "DATA_SETS", (chosen,))
    monkeypatch.setenv("MRDAMPER_DATA", str(mirror))
    return mirror


def test_public_datasets_have_commit_and_licence():
    assert {known.name for known in list_sets()} == {"utfsm", "utfpr"}
    for known in list_sets():
        assert re.fullmatch(r"[0-9a-f]{40}", known.commit)
        assert known.licence == "MIT"
        assert known.files
        for file in known.files:
            assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
            assert known.url(file).startswith(
                f"https://raw.githubusercontent.com/{known.repository}/{known.commit}/"
            )
            assert " " not in known.url(file)
        assert (Path(__file__).parents[2] / "examples" / known.channels).is_file()


def test_data_files_are_copied_from_mirror(small_set, tmp_path):
    target = fetch("small", folder=tmp_path / "kept")
    assert (target / "a.csv").read_bytes() == CONTENT
    assert (target / "b.csv").read_bytes() == CONTENT * 2
    assert sorted(file.name for file in target.iterdir()) == ["a.csv", "b.csv"]


def test_mirror_file_with_wrong_hash_is_rejected(small_set, tmp_path):
    (small_set / "raw" / "a.csv").write_bytes(b"other")
    with pytest.raises(InputError, match=r"is not a\.csv of small at 00000000: SHA-256 .*expected"):
        fetch("small", folder=tmp_path / "kept")
    assert not (tmp_path / "kept" / "a.csv").exists()


def test_download_with_wrong_hash_is_rejected(small_set, tmp_path, monkeypatch):
    asked = []

    def forge(url, timeout):
        asked.append(url)
        return io.BytesIO(b"other")

    monkeypatch.delenv("MRDAMPER_DATA")
    monkeypatch.setattr(urllib.request, "urlopen", forge)
    monkeypatch.setattr(public_data, "_cache", lambda: tmp_path / "cache")
    with pytest.raises(InputError, match=r"a\.csv: is not a\.csv of small"):
        fetch("small", folder=tmp_path / "kept")
    assert asked[0].startswith("https://")
    assert not list((tmp_path / "kept").iterdir())
    sent = {"a": CONTENT, "b": CONTENT * 2}
    monkeypatch.setattr(urllib.request, "urlopen", lambda url, timeout: io.BytesIO(sent[url[-5]]))
    target = fetch("small", folder=tmp_path / "kept")
    assert {each.stem: each.read_bytes() for each in target.iterdir()} == sent


def test_mirrored_public_files_have_expected_hashes(real_data, tmp_path):
    for name, expected in (("utfsm", {"ME5mm3Hz.txt"}), ("utfpr", {"ensaio.A.1.mat", "ensaio.A.3.mat"})):
        target = fetch(name, folder=tmp_path / name)
        assert expected <= {file.name for file in target.iterdir()}


def test_installed_channel_maps_equal_examples():
    examples = Path(__file__).parents[2] / "examples"
    names = {each.channels for each in list_sets()}
    assert {path.name for path in MAPS.iterdir() if path.suffix == ".toml"} == names
    for name in names:
        assert (MAPS / name).read_bytes() == (examples / name).read_bytes()
