"""Notes: what a reader of a result should know, as data that reads as its words.

A note has a kind and fields, so that a program can look for one and take its figures; as a text it is the
sentence that its form and fields make, which is what terminal, page and JSON show. Options and commands
stand in it by ``errors.option`` and ``errors.command``, and each face spells them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any


class Note(str):
    """One note, a text.

    Parameters
    ----------
    kind : its name, for programs; one of each thing that is noted
    form : its words, each field by its name in braces, with a format where that is a number
    fields : plain values [units in their names]
    """

    kind: str
    fields: Mapping[str, Any]
    _form: str

    def __new__(cls, kind: str, form: str, /, **fields: Any) -> Note:  # noqa: ANN401 - plain values
        made = super().__new__(cls, form.format_map(fields))
        made.kind, made._form, made.fields = kind, form, MappingProxyType(fields)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, (self.kind, self._form, dict(self.fields))


def _made(kind: str, form: str, fields: Mapping[str, Any]) -> Note:
    return Note(kind, form, **fields)


def note_kinds(notes: Iterable[str]) -> list[dict[str, Any]]:
    """Return kind and fields of the notes that have them, in order, as JSON holds them."""
    return [{"kind": each.kind, **each.fields} for each in notes if isinstance(each, Note)]
