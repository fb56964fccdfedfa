"""Write the Python functions of the jobs from their declarations: ``python -m tests.support.interface``.

The functions are the last part of ``mrdamper/__init__.py``. A test compares them with the declarations.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, get_args, get_origin

from mrdamper.registry import JOBS, Job
from mrdamper.results import load
from mrdamper.schema import Field

FILE = Path(__file__).parents[2] / "src" / "mrdamper" / "__init__.py"
MARK = "# The rest of this module is written by `make interface` from the declarations of the jobs.\n"
WIDTH = 110
BUILT_IN = {"Any", "None", "bool", "float", "int", "list", "str", "tuple"}
PREFERRED_MODULES = {"Path": "pathlib", "Sequence": "collections.abc", "Literal": "typing"}


def interface() -> str:
    """Return the generated part of ``mrdamper/__init__.py``: imports, and a function for each job."""
    types: dict[str, str] = {}
    functions = [function_of(job, types) for job in JOBS.values()]
    imports: dict[str, list[str]] = {}
    for name, module in types.items():
        imports.setdefault(module, []).append(name)
    standard = [module for module in sorted(imports) if module.split(".")[0] in sys.stdlib_module_names]
    lines = [
        f"    from {module} import {', '.join(sorted(imports[module], key=str.lower))}"
        for module in (*standard, *sorted(set(imports) - set(standard)))
    ]
    lines.insert(len(standard), "")
    return "\n".join([MARK + "# fmt: off\n\nif TYPE_CHECKING:", *lines, "", *functions])


def function_of(job: Job, types: dict[str, str]) -> str:
    """Return the source of a job's function. Add the names and modules of its types to ``types``."""
    run = load(job.run)
    returned = named(inspect.get_annotations(run)["return"], run.__module__, types)
    first = [
        f"{each.name}: {input_type(job, each, types)}{'' if each.required else f' = {each.default!r}'}"
        for each in ordered(job.inputs)
    ]
    rest = [
        f"{field.name}: {option_type(field, types)}{'' if field.required else f' = {field.default!r}'}"
        for field in (*job.reading, *job.fields)
    ]
    path = named("str | Path", "", types)
    rest += [f"{each.name}: {path} | None = None" for each in job.outputs]
    if job.progress_word:
        rest.append(f"on_progress: {named('Progress', 'mrdamper.runtime.progress', types)} | None = None")
    parameters = [*first, *(["*", *rest] if rest else [])]
    head = f"def {job.attribute}({', '.join(parameters)}) -> {returned}:"
    if len(head) > WIDTH:
        lines = wrapped(f"{', '.join(map(unbroken, parameters))},", WIDTH - 4)
        head = "\n".join([f"def {job.attribute}(", *(f"    {line}" for line in lines), f") -> {returned}:"])
    head = head.replace("'", '"')
    return f'\n{head}\n{documentation(job)}\n    return _run("{job.name}", locals())\n'


def unbroken(parameter: str) -> str:
    """Return the parameter with non-breaking spaces if it is short, so that it stays on one line."""
    return parameter.replace(" ", "\N{NO-BREAK SPACE}") if len(parameter) < WIDTH - 4 else parameter


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Return the lines of a wrapped text. Lines do not break at hyphens."""
    lines = textwrap.wrap(text, width, subsequent_indent=indent, break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def ordered(inputs: tuple[Field, ...]) -> list[Field]:
    """Return the inputs of a job, with required inputs first."""
    return sorted(inputs, key=lambda each: not each.required)


def documentation(job: Job) -> str:
    """Return the docstring of a function: the first paragraph of the help, then a line per parameter."""
    first, _, more = job.help.partition("\n\n")[0].partition(". ")
    lines = [first.removesuffix(".") + ".", *(["", *wrapped(more, WIDTH - 4)] if more else [])]
    entries = [(each.name, each.help, each.option.default_help) for each in ordered(job.inputs)]
    for field in (*job.reading, *job.fields):
        option = field.option
        unit = f" [{option.unit}]" if option.unit else ""
        limits = field.item_option.range_words or option.range_words
        limits = f", {limits}" if unit and limits else ""
        help_text = f"{field.help.removesuffix('.')}{unit}{limits}."
        entries.append((field.name, help_text, "" if field.default else option.default_help))
    entries += [(each.name, each.help, "") for each in job.outputs]
    if entries:
        lines += ["", "Parameters", "----------"]
    for name, help_text, default in entries:
        # The remark is removed because the Python function accepts a list.
        said = re.sub(r" \(may be repeated\)|; may be repeated", "", help_text)
        said += f" Default: {default}." if default else ""
        lines += wrapped(f"{name} : {said}", WIDTH - 4, "    ")
    lines = [f'"""{lines[0]}', *lines[1:], '"""'] if lines[1:] else [f'"""{lines[0]}"""']
    return "\n".join(f"    {line}".rstrip() for line in lines)


# ------------------------------------------------------------------------------------------- types


def input_type(job: Job, each: Field, types: dict[str, str]) -> str:
    """Return the union of the types that the job and the reader of the input accept."""
    run, reader = load(job.run), load(each.option.read) if each.option.read else None
    accepted = [] if each.many and reader else [(inspect.get_annotations(run)[each.name], run.__module__)]
    if reader is not None:
        accepted.append((next(iter(inspect.get_annotations(reader).values())), reader.__module__))
    if each.many and accepted[-1][0] != "Runs":
        accepted.insert(0, ("str | Path", "pathlib"))
    parts = [part for text, module in accepted for part in members(named(text, module, types))]
    is_optional = not (each.required or each.default)
    return " | ".join([*dict.fromkeys(part for part in parts if part != "None"), *["None"] * is_optional])


def members(annotation: str) -> list[str]:
    """Return the members of a union type."""
    node = ast.parse(annotation, mode="eval").body
    found: list[str] = []
    while isinstance(node, ast.BinOp):
        found.insert(0, ast.unparse(node.right))
        node = node.left
    return [ast.unparse(node), *found]


def option_type(field: Field, types: dict[str, str]) -> str:
    """Return the type of an option."""
    item = field.item
    if get_origin(item) is Literal:
        text = f"Literal[{', '.join(map(repr, get_args(item)))}]"
    else:
        text = "str | Path" if item is Path else item.__name__
    text = f"Sequence[{text}]" if field.many else text
    return named(text, "", types) + (" | None" if field.optional else "")


def named(annotation: str, module: str, types: dict[str, str]) -> str:
    """Return an annotation. Add its names, with the modules that define them, to ``types``."""
    known = dict(defined_in(module)) if module else {}
    for node in ast.walk(ast.parse(annotation)):
        if isinstance(node, ast.Name) and node.id not in BUILT_IN:
            types[node.id] = PREFERRED_MODULES.get(node.id) or known.get(node.id, module)
    return annotation


def defined_in(module: str) -> Iterator[tuple[str, str]]:
    """Yield each name that a module imports, with the module that defines the name."""
    for node in ast.walk(ast.parse(inspect.getsource(sys.modules[module]))):
        if isinstance(node, ast.ImportFrom):
            yield from ((alias.name, str(node.module)) for alias in node.names)


if __name__ == "__main__":
    hand_written, _, _ = FILE.read_text(encoding="utf-8").partition(MARK)
    FILE.write_text(hand_written + interface(), encoding="utf-8")
