"""Reads a case file into a validated case, or into the list of all its problems."""

from __future__ import annotations

import hashlib
import io
import json
import re
import tomllib
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from itertools import count, islice
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mlsanm_cli.case.model.case import Case, completed
from mlsanm_cli.case.model.conditions import listed
from mlsanm_cli.case.model.section import Geometry, Scope, all_faults, split_boundary
from mlsanm_cli.case.model.shapes import AnyShape
from mlsanm_cli.case.reading.overrides import apply_overrides, key_path
from mlsanm_cli.case.report import (
    KeyPath,
    Report,
    child,
    items_of,
    nearest,
    number_faults,
    size_faults,
    suggestion,
    text_problem,
)
from mlsanm_cli.errors import CaseError, CaseProblem, Fault, GeometryError, OutlineError, RunError
from mlsanm_cli.inputs import MAX_TEXT_BYTES, STDIN, is_text, read_input
from mlsanm_cli.records import dataclass
from mlsanm_cli.toml import plain

GeometryOf = Callable[[AnyShape], Geometry]
"""The geometry of a shape. The case layer does no geometry and reads no geometry files. Raises GeometryError
if the shape is not a valid body."""


@dataclass(frozen=True)
class LoadedCase:
    """A validated case with the text it came from. ``case_hash`` is the SHA-256 of the resolved content:
    equal for equal cases, however they are written."""

    case: Case
    raw: str
    path: Path
    overrides: tuple[str, ...]
    case_hash: str

    def located(self, error: CaseError) -> CaseError:
        """The problems with file and line, found by their keys (list items by name)."""
        content, changed, _ = apply_overrides(tomllib.loads(self.raw), self.overrides)
        report = Report(content, self.raw, str(self.path), changed)
        report.add(Fault(key_path(content, one.key), one.message, one.hint) for one in error.problems)
        return CaseError(report.problems)


def load_case(path: Path, overrides: Sequence[str] = (), geometry_of: GeometryOf | None = None) -> LoadedCase:
    """Reads and validates a case file with overrides; without ``geometry_of`` neither geometry nor names of
    boundaries are checked. Raises RunError if it cannot be read, and CaseError with every problem."""
    if not is_text(path.absolute()):
        # Files of bodies are stored with their absolute path.
        raise RunError(f"the path {str(path.absolute())!r} is not UTF-8 text", "rename the directories in it")
    try:
        content = read_input(path, MAX_TEXT_BYTES, what="case file", streams=True)
    except RunError as error:
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
        try:
            there = {one.stem: one for one in sorted(path.parent.glob("*.toml"))[:1000]}
        except (OSError, ValueError):
            raise error from None
        hint = f"existing cases: {', '.join(map(str, list(there.values())[:5]))}"
        if near := nearest(path.stem, there):
            hint = f"did you mean {there[near]}?"
        raise RunError(error.message, hint if there else "mlsanm new writes a starter case") from error
    try:
        # utf-8-sig drops the byte order mark that some editors write.
        text = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig").read()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        hint = "a case is a text file: in the editor save it with the encoding UTF-8"
        raise RunError(f"{path} is not UTF-8 text (line {line}, byte {error.start})", hint) from error
    if path == STDIN:
        path = Path("stdin")
    return parse_case(text, path, overrides, geometry_of)


def parse_case(
    text: str, path: Path, overrides: Sequence[str] = (), geometry_of: GeometryOf | None = None
) -> LoadedCase:
    """Validates the text of the file at ``path``, to which other files are relative. Raises CaseError."""
    source = str(path)
    content = _parse_toml(text, source)
    report = Report(content, text, source)
    report.refuse(size_faults(content))
    content, changed, bad_overrides = apply_overrides(content, overrides)
    if changed:
        report = Report(content, text, source, changed)
        report.refuse(size_faults(content))
    data = _frozen(content)
    report = Report(data, text, source, changed)
    report.add(number_faults(data))
    case, faulty = _validated(data, path.parent, report)
    scope = None if case is None else _check_relations(case, geometry_of, report, data, faulty)
    problems = report.problems + bad_overrides
    if problems or scope is None:
        raise CaseError(problems)
    bodies = []
    for body in scope.case.body:
        digest = scope.geometries[body.name].digest if body.name in scope.geometries else ""
        shape = body.shape.model_copy(update={"sha256": digest} if digest else {})
        bodies.append(body.model_copy(update={"shape": shape}))
    case = scope.case.model_copy(update={"body": tuple(bodies)})
    return LoadedCase(case, text, path, tuple(overrides), case_hash(case))


def _validated(data: Any, folder: Path, report: Report) -> tuple[Case | None, frozenset[KeyPath]]:
    """The case of the content of a file, and the paths of what it leaves out: the smallest parts without
    which the rest is valid, but for unknown keys. None if there is no such rest. Files are relative to
    ``folder``. Adds all problems to the report, except where it has one already."""
    unknown, faulty = set[KeyPath](), set[KeyPath]()
    while True:
        removed = unknown | faulty
        # Faults of tables that every case has hide none of others.
        required = {"format": 1, "model": {"plane": "stress"}} if faulty else {}
        rest = {**required, **_without(data, removed)}
        try:
            return completed(Case.model_validate(rest, context=folder)), frozenset(faulty)
        except ValidationError as error:
            from mlsanm_cli.case.schema import UNKNOWN_KEY, fault_of

            known = report.paths | faulty
            faults = [fault_of(rest, detail) for detail in error.errors(include_url=False)]
            faults = [replace(fault, key=_place(fault.key, removed)) for fault in faults]
            report.add(f for f in faults if not any(f.key[:n] in known for n in range(len(f.key) + 1)))
            unknown |= {fault.key for fault in faults if fault.message == UNKNOWN_KEY}
            for path in (fault.key for fault in faults if fault.key not in unknown):
                while path and (path in faulty or reduce(child, path, data) is None):
                    path = path[:-1]
                faulty.add(path)
            if () in faulty:
                return None, frozenset(faulty)


def _without(value: Any, removed: Collection[KeyPath], path: KeyPath = ()) -> Any:
    """The content without the removed parts."""
    kept = [(step, item, (*path, step)) for step, item in items_of(value) if (*path, step) not in removed]
    parts = {step: _without(item, removed, place) for step, item, place in kept}
    return parts if isinstance(value, dict) else tuple(parts.values()) if isinstance(value, tuple) else value


def _place(path: KeyPath, removed: Collection[KeyPath]) -> KeyPath:
    """The path in the whole content of a path in the content without the removed parts."""
    whole: KeyPath = ()
    for step in path:
        if isinstance(step, int):
            gone = {place[-1] for place in removed if place[:-1] == whole}
            step = next(islice((number for number in count() if number not in gone), step, None))
        whole = (*whole, step)
    return whole


def _check_relations(
    case: Case, geometry_of: GeometryOf | None, report: Report, data: Any, faulty: frozenset[KeyPath]
) -> Scope:
    """Adds every relation between keys that does not hold, but for tables with ``faulty`` parts; returns the
    case with the geometries of its bodies."""
    absent = {path[:2]: "" for path in faulty}
    for path in faulty:
        if len(path) == 2:
            absent[path] = str(reduce(child, (*path, "name"), data) or path[1])
    scope = Scope(case, absent=tuple((str(path[0]), name) for path, name in absent.items()))
    geometries: dict[str, Geometry] = {}
    for index, body in enumerate(case.body):
        if geometry_of is None or any(all_faults(body.shape, scope)):
            continue
        try:
            geometries.setdefault(body.name, geometry_of(body.shape))
        except (OutlineError, GeometryError) as error:
            own = [Fault(("file",), error.message, error.hint)]
            own = list(error.faults) if isinstance(error, OutlineError) else own
            report.add(replace(f, key=_place(("body", index, "shape", *f.key), faulty)) for f in own)
    scope = replace(scope, geometries=geometries)
    tables = {path[:-1] for path in faulty if len(path) > 2 or path[0] not in (*LISTS, "material")}
    for fault in (*_name_faults(scope), *all_faults(case, scope)):
        place = _place(fault.key, faulty)
        if not {place, place[:-1]} & tables:
            report.add([replace(fault, key=place)])
    return scope


REFERENCES = (("body", "material"), ("support", "body"), ("load", "body"), ("probe", "body"))
"""Section and key of a name, which is that of the section of the item that it names."""


def _name_faults(scope: Scope) -> Iterator[Fault]:
    """Names declared twice, unknown ones, and materials of no body."""

    def texts(section: str, key: str) -> Iterator[tuple[KeyPath, str]]:
        """Path and text of a key of every item of a list, or of each text if the key has several."""
        for number, item in enumerate(getattr(scope.case, section)):
            value = getattr(item, key, None)
            path: KeyPath = (section, number, key)
            for place, text in enumerate(listed(value)):
                yield (*path, place) if isinstance(value, tuple) else path, text

    def unknown(path: KeyPath, name: str, section: str, text: str = "") -> Iterator[Fault]:
        names, plural = scope.names(section), "bodies" if section == "body" else f"{section}s"
        if name not in names:
            yield Fault(path, f'{text}there is no {section} "{name}"', suggestion(name, names, plural))

    for section in ("material", "body", "load", "contact", "probe"):
        names = scope.names(section)
        for number, name in enumerate(names[: len(getattr(scope.case, section))]):
            if name in names[:number]:
                yield Fault((section, number, "name"), f'another {section} is called "{name}" already')
    for section, key in REFERENCES:
        for path, name in texts(section, key):
            yield from unknown(path, name, key)
    used = [body.material for body in scope.case.body]
    for name in scope.case.material:
        if name not in used and not scope.missing("body"):
            hint = f'remove it, or write material = "{name}" in a body'
            yield Fault(("material", name), "no body uses this material", hint)
    sides = (("support", "boundary"), ("load", "boundary"), ("contact", "slave"), ("contact", "master"))
    for section, key in sides:
        for path, boundary in texts(section, key):
            body, edge = split_boundary(boundary)
            yield from unknown(path, body, "body", f'"{boundary}": ')
            edges = scope.geometries[body].boundaries if body in scope.geometries else ()
            if edges and edge not in edges:
                hint = suggestion(boundary, [f"{body}.{valid}" for valid in edges], "boundaries")
                yield Fault(path, f'body "{body}" has no boundary "{edge}"', hint)


def stored_case(text: str) -> Case:
    """The resolved case of a run; its files need not exist any more. Raises RunError."""
    try:
        return completed(Case.model_validate(_frozen(tomllib.loads(text))))
    except ValueError as error:
        raise RunError("the case stored in the run is damaged or from another version") from error


def resolved_mapping(case: Case) -> dict[str, Any]:
    """The case as nested plain values with all defaults; keys without a value are omitted. Written as TOML
    and loaded again, it gives an equal case."""
    found: dict[str, Any] = plain(case.model_dump(mode="python", exclude_none=True, by_alias=True))
    return found


def case_hash(case: Case) -> str:
    """SHA-256 of the resolved content in canonical form; files enter by content, not by path."""
    content = resolved_mapping(case)
    for body in content["body"]:
        if "sha256" in body["shape"]:
            del body["shape"]["file"]
    text = json.dumps(content, sort_keys=True, ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


LISTS = ("body", "support", "load", "contact", "stage", "stop", "probe")
"""Tables that are lists of items."""
NESTED = {"shape": "body.shape", "refine": "body.refine", "regularization": "contact.regularization"}
"""Tables that belong to a list item, by the last part of their names."""


def _parse_toml(text: str, source: str) -> dict[str, Any]:
    line, problem = text_problem(text)
    if line:
        raise CaseError((CaseProblem("(file)", problem, line, source, "far more than any case needs"),))
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise CaseError((CaseProblem("(file)", "lists are nested too deeply", 1, source),)) from error
    except ValueError as error:
        message, lines = str(error), text.splitlines() or [""]
        line = 1
        if place := re.search(r" \(at (?:line (\d+), column \d+|end of document)\)$", message):
            message = message[: place.start()]
            line = int(place[1] or len(lines))
        if names := re.fullmatch(r"Cannot declare \((.*)\) twice", message):
            message = f"[{'.'.join(re.findall('[^(), ]+', names[1]))}] is declared twice".replace("'", "")
        hint = _syntax_hint(message, lines[line - 1])
        raise CaseError((CaseProblem("(syntax)", message, line, source, hint),)) from error


def _syntax_hint(message: str, line: str) -> str:
    """A correction, from the parser's message and the line that it refers to."""
    if any(quote in line for quote in "“”„"):
        return 'write straight quotes: "'
    if line.lstrip().startswith("{"):
        return "a case is TOML, not JSON: lines as nu = 0.3 below the headings of tables as [material.steel]"
    comma = re.search(r"=\s*([-+]?\d+),(\d+)\s*(#.*)?$", line)
    if comma is not None:
        return f"write a decimal point: {comma[1]}.{comma[2]}"
    if re.search(r"=\s*(True|False)\b", line):
        return "true and false are written in lower case"
    if sum(map(line.count, "\"'")) % 2:
        return "a quote is missing at the end of the text"
    if message.startswith("Expected '='"):
        return "write KEY = VALUE"
    if message.startswith("Invalid value"):
        return "text needs quotes, numbers need a digit before and after the point"
    if "overwrite" in message.lower():
        header = line.lstrip().startswith("[")
        return "write it below the item to which it belongs" if header else "the key is defined twice"
    name = line.strip().strip("[]").strip()
    if "twice" in message and name in LISTS:
        return f"write [[{name}]] above each one"
    return f"[{NESTED[name]}] belongs to the item above" if "twice" in message and name in NESTED else ""


def _frozen(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _frozen(item) for key, item in value.items()}
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
