"""Questions about data that a file does not contain, and the answers of the user.

A question has a role, a topic (unit, column, scale, value, sampling rate, or part of the time), a file,
and candidates for the answer. An answer is ``ROLE.TOPIC=VALUE``. It applies to all files (``force.unit=kN``),
or to the files that match a pattern before it (``run_1*:current.value=0.5 A``).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import PurePath
from typing import Any, Literal, cast, get_args

from mrdamper.data.channels import Channel, ChannelMap
from mrdamper.errors import InputError, MrdamperError
from mrdamper.quantities import QUANTITIES, to_si
from mrdamper.schema import unknown_name

Topic = Literal["unit", "rate", "column", "scale", "value", "part"]
_EXPECTED: Mapping[Topic, str] = {
    "unit": "a unit in the header (such as {role}_{unit}), or `unit` at [channel.{role}] in a channel map "
    "(--channels FILE): {units}",
    "column": "one column with a header such as {role}_{unit}, or [channel.{role}] in a channel map "
    "(--channels FILE)",
    "scale": "a line such as 'scale: 10 {unit}/V' above the table, or `gain` and `unit` ('V' or '%') at "
    "[channel.{role}] in a channel map (--channels FILE)",
    "value": "a column such as {role}_{unit}, or {role}_{unit} at [constant] in a channel map "
    "(--channels FILE)",
    "rate": "a column such as time_s, or rate_Hz at [constant] in a channel map (--channels FILE)",
    "part": "clocks that cover the same time, the answer time.part=common, or common_time = true at [file] "
    "in a channel map (--channels FILE)",
}
_ANSWER = re.compile(r"(?:(?P<files>[^=]+):)?(?P<role>[a-z]+)\.(?P<topic>[a-z]+)=(?P<value>.+)", re.DOTALL)
_SCALED = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s/]*)\s*(?:/\s*(m?V|(?:100\s*)?%))?\s*"
)


@dataclass(frozen=True, slots=True)
class Question:
    """A question about one missing item of a file."""

    role: str
    topic: Topic
    file: str  # Name of the file.
    text: str
    candidates: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Return the first part of an answer to this question, such as ``force.unit``."""
        return f"{self.role}.{self.topic}"

    def to_dict(self) -> Mapping[str, object]:
        """Return the fields as JSON values."""
        answer = f"{self.key}={self.candidates[0] if len(self.candidates) == 1 else '...'}"
        return asdict(self) | {"candidates": list(self.candidates), "answer": answer}


class AskingError(InputError):
    """Error for a file that can be read when the user has answered the questions."""

    def __init__(self, found: str = "", *, questions: Sequence[Question] = (), **parts: Any) -> None:  # noqa: ANN401 - the base's
        super().__init__(found, **parts)
        self._questions = tuple(questions)

    @property
    def questions(self) -> tuple[Question, ...]:
        """Return the questions of the error and of all ``faults``, each with its file."""
        inner = (each for fault in self.faults if isinstance(fault, AskingError) for each in fault.questions)
        return (*(replace(question, file=self.place) for question in self._questions), *inner)


class NoRunError(AskingError):
    """Error for a file without damper samples, such as results or the data of a different instrument."""


def ask(role: str, topic: Topic, place: str, found: str, candidates: Sequence[str] = ()) -> AskingError:
    """Return an AskingError with one question about a role in the file ``place``."""
    quantity = QUANTITIES[role]
    expected = _EXPECTED[topic].format(role=role, unit=quantity.unit, units=", ".join(quantity.units))
    question = Question(role, topic, place, f"{found}; expected {expected}", tuple(candidates))
    return AskingError(place=place, found=found, expected=expected, questions=(question,))


def ask_all(faults: Sequence[InputError]) -> InputError:
    """Return one error that combines the questions of several errors."""
    faults = [*{str(fault): fault for fault in faults}.values()]  # Runs of one file may have equal faults.
    if len(faults) == 1:
        return faults[0]
    are_questions = any(isinstance(fault, AskingError) for fault in faults)
    return AskingError(faults=faults) if are_questions else InputError(faults=faults)


def relocate(fault: MrdamperError, name: str, shown: str) -> None:
    """Replace ``name`` with ``shown`` at the beginning of ``place``, in an error and all its ``faults``."""
    for item in fault.faults:
        relocate(item, name, shown)
    if fault.place.startswith(name) or not fault.place:
        fault.place = fault.place.replace(name, shown, 1)


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of the user to a question about a role, for all files or for files that match a pattern."""

    role: str
    topic: Topic
    value: str
    files: str = "*"  # Pattern of the file names.


def parse_answers(given: Sequence[str]) -> tuple[Answer, ...]:
    """Parse answers ``FILES:ROLE.TOPIC=VALUE`` (files optional). Raise InputError for other forms."""
    answers = []
    for text in given:
        place, found = f"answer {text!r}", _ANSWER.fullmatch(text.strip())
        if found is None:
            expected = "ROLE.TOPIC=VALUE, such as force.unit=kN"
            raise InputError(place=place, found="its form is not valid", expected=expected)
        role, topic, value, files = found.group("role", "topic", "value", "files")
        if role not in QUANTITIES:
            raise unknown_name("no role", role, QUANTITIES, place)
        if topic not in get_args(Topic):
            raise unknown_name("no topic", topic, get_args(Topic), place)
        answers.append(Answer(role, cast(Topic, topic), value.strip(), files or "*"))
    return tuple(answers)


def with_answers(chosen: ChannelMap, answers: Sequence[Answer], file: PurePath) -> ChannelMap:
    """Return a channel map that includes the answers for a file."""
    channels, constant, rate = dict(chosen.channels), dict(chosen.constant), chosen.rate_Hz
    file_options = chosen.file
    for answer in answers:
        # The pattern fits the last parts of the path.
        if not fnmatchcase(f"/{file.as_posix()}", f"*/{answer.files}"):
            continue
        channel = channels.get(answer.role) or Channel(answer.role)
        if answer.topic == "unit":
            channels[answer.role] = replace(channel, unit=answer.value)
        elif answer.topic == "column":
            channels[answer.role] = replace(channel, name=answer.value, pattern=None, index=None)
        elif answer.topic == "scale":
            gain = _number(answer, QUANTITIES[answer.role].unit)
            unit = "%" if answer.value.endswith("%") else "V"
            channels[answer.role] = replace(channel, gain=gain, unit=unit)
        elif answer.topic == "rate":
            rate = _number(answer, "Hz")
        elif answer.topic == "part":
            if (answer.role, answer.value) != ("time", "common"):
                place = f"answer {answer.role}.part={answer.value}"
                raise InputError(place=place, found="no such part", expected="time.part=common")
            file_options = replace(file_options, common_time=True)
        else:
            constant[answer.role] = _number(answer, QUANTITIES[answer.role].unit)
    return replace(chosen, channels=channels, constant=constant, rate_Hz=rate, file=file_options)


def _number(answer: Answer, unit: str) -> float:
    """Return the number of an answer, converted to ``unit``. A scale is ``unit`` per volt or per 1 %."""
    found = _SCALED.fullmatch(answer.value)
    place = f"answer {answer.role}.{answer.topic}={answer.value}"
    if found is None:
        raise InputError(place=place, found="no number", expected=f"a number, in {unit} without a unit")
    value, spelled = float(found[1]), found[2] or unit
    if unit == "Hz":
        if not (rate := value * {"Hz": 1.0, "kHz": 1e3}.get(spelled, 0.0)) > 0.0:
            raise InputError(
                place=place, found=f"{answer.value!r}", expected="a positive number of Hz or kHz"
            )
        return rate
    value = float(to_si(value, spelled, answer.role))
    if found[3] == "mV":
        return value * 1e3
    return value / 100.0 if (found[3] or "").startswith("100") else value
