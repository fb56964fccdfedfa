"""The file that a long job goes on from: what is taken from it, what is refused, when it vanishes."""

from __future__ import annotations

from pathlib import Path

import pytest

from mrdamper.errors import InputError, spelled
from mrdamper.runtime import checkpoint
from mrdamper.runtime.checkpoint import Checkpoint, checkpointed, place_of
from mrdamper.runtime.signals import Interrupted
from tests.support.kills import rows

HEAD = {"job": "heatsink", "seed": 1, "options": {"members": 12}}
THIRD = 1.0 / 3.0


def begun(path: Path, parts: int = 3) -> None:
    """Leave what a job leaves that was killed after so many parts."""
    kept = Checkpoint(path, HEAD, resume=False)
    for k in range(parts):
        kept.keep(f"part {k}", {"cost": k * THIRD})
    kept.close()


def test_what_was_kept_comes_back_to_the_last_digit(tmp_path: Path):
    begun(tmp_path / "a")
    again = Checkpoint(tmp_path / "a", HEAD, resume=True)
    assert again.recall("part 2") == {"cost": 2 * THIRD}
    assert again.recall("part 3") is None
    again.close()


@pytest.mark.parametrize("cut", [1, 20])
def test_a_torn_last_line_is_dropped_and_written_again(tmp_path: Path, cut: int):
    path = tmp_path / "a"
    begun(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    again = Checkpoint(path, HEAD, resume=True)
    assert list(again.done) == ["part 0", "part 1"]
    again.keep("part 2", {"cost": 2 * THIRD})
    again.close()
    assert path.read_bytes() == whole


def test_a_torn_first_line_is_no_progress(tmp_path: Path):
    path = tmp_path / "a"
    begun(path)
    path.write_bytes(path.read_bytes()[:15])
    again = Checkpoint(path, HEAD, resume=True)
    assert not again.done
    again.keep("part 0", {})
    again.close()
    assert rows(path) == 2


def test_what_a_loss_of_power_left_in_the_middle_is_done_again(tmp_path: Path):
    """A block that never reached the disk reads as zeros."""
    path = tmp_path / "a"
    begun(path)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[1] + bytes(len(lines[2]) - 1) + b"\n" + lines[3])
    again = Checkpoint(path, HEAD, resume=True)
    assert list(again.done) == ["part 0"]
    again.close()


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ({**HEAD, "seed": 2}, r"another run \(another seed\)"),
        ({**HEAD, "options": {"members": 2}, "data": "x"}, r"another run \(another options, data\)"),
    ],
)
def test_progress_of_another_run_is_refused_and_stays(tmp_path: Path, head: dict[str, object], said: str):
    path = tmp_path / "a"
    begun(path)
    before = path.read_bytes()
    with pytest.raises(InputError, match=said):
        Checkpoint(path, head, resume=True)
    assert path.read_bytes() == before


def test_a_file_that_is_none_of_ours_is_refused_and_stays(tmp_path: Path):
    (tmp_path / "a").write_text("3\n4\n", encoding="utf-8")
    with pytest.raises(InputError, match="something else"):
        Checkpoint(tmp_path / "a", HEAD, resume=True)
    assert (tmp_path / "a").read_text(encoding="utf-8") == "3\n4\n"


def test_progress_is_one_run_s_at_a_time(tmp_path: Path):
    path = tmp_path / "a"
    begun(path)
    first = Checkpoint(path, HEAD, resume=True)
    for resume in (True, False):
        with pytest.raises(InputError, match="another run is at work with it"):
            Checkpoint(path, HEAD, resume=resume)
    first.close()
    assert rows(path) == 4
    Checkpoint(path, HEAD, resume=True).close()


def test_a_file_that_its_owner_removes_meanwhile_is_not_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path, asked = tmp_path / "a", list[int]()

    def lock_late(_: int) -> bool:
        asked.append(1)
        if len(asked) == 1:
            path.unlink()
        return True

    monkeypatch.setattr(checkpoint, "lock", lock_late)
    kept = Checkpoint(path, HEAD, resume=True)
    kept.keep("part 0", {})
    assert rows(path) == 2
    kept.close()


def test_without_resume_progress_is_given_up_aloud(tmp_path: Path):
    begun(place_of(tmp_path / "out"))
    said: list[str] = []
    with checkpointed(tmp_path / "out", HEAD, resume=False, on_note=said.append) as kept:
        assert kept is not None
        assert not kept.done
    assert len(said) == 1
    assert "given up; --resume would have gone on with it" in spelled(said[0])


def test_progress_vanishes_with_a_good_end_and_no_other(tmp_path: Path):
    out = tmp_path / "deep" / "out"
    for end in (InputError("no"), KeyboardInterrupt(), Interrupted()):
        with pytest.raises(type(end)) as caught, checkpointed(out, HEAD, resume=False) as kept:  # noqa: PT012
            assert kept is not None
            kept.keep("part 0", {})
            raise end
        assert rows(place_of(out)) == 2
        hint = "what was finished is kept: the same command with ⟦--resume⟧ goes on"
        assert getattr(caught.value, "__notes__", []) == ([] if isinstance(end, InputError) else [hint])
    with checkpointed(out, HEAD, resume=True) as kept:
        assert kept is not None
        assert kept.recall("part 0") == {}
        kept.finished = True
    assert not place_of(out).exists()


def test_a_run_that_finished_nothing_leaves_nothing(tmp_path: Path):
    with pytest.raises(KeyboardInterrupt), checkpointed(tmp_path / "new" / "out", HEAD, resume=True):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_progress_lies_beside_the_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert place_of(Path("out")) == Path("out.progress")
    assert place_of(Path("a/out.d")) == Path("a/out.d.progress")
    assert place_of(Path()) == tmp_path / "here.progress"
    assert place_of(Path("..")) == tmp_path.with_name(f"{tmp_path.name}.progress")
    assert place_of(Path("/")) == Path("/.progress")
