"""Plane meshes of Abaqus input files, with parts, instances and the assembly, of which meshio, which reads
all other formats, takes the last block of nodes only. Numbers and names are those of a `_Scope`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from typing import NamedTuple

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import GeometryError

Grid = tuple[FloatArray, list[tuple[str, IntArray, list[list[str]]]], dict[str, IntArray]]
"""Points (p, 3), blocks of elements (kind, nodes (e, k) and names of the groups of each element), and sets of
nodes."""
_COUNTS = {"triangle": 3, "quad": 4, "triangle6": 6, "quad8": 8, "quad9": 9, "line": 2, "line3": 3}
_TYPES = {
    **{kind: rf"(CP(S|E|EG)|SFM3D|M3D|R3D|STRI|S|DC2D|AC2D){_COUNTS[kind]}[A-Z0-9]*" for kind in _COUNTS},
    "line": "(T[23]D2|B[23][13]|R2D2).*",
    "line3": "(T[23]D3|B[23]2).*",
}
"""Abaqus' types of elements by the kinds of meshio."""
_REFUSED = {
    "INCLUDE": "replace *INCLUDE by the lines of that file",
    **dict.fromkeys(("SYSTEM", "NGEN", "NFILL", "NCOPY", "NMAP"), "write all nodes in global coordinates"),
    **dict.fromkeys(("ELGEN", "ELCOPY"), "write all elements"),
}
"""Keywords that make or move nodes and elements, or read other files, with a way to do without."""


class _Section(NamedTuple):
    """A keyword with its parameters, and the values of its data lines."""

    line: int
    keyword: str
    parameters: dict[str, str]
    rows: list[list[str]]

    def refuse(self, message: str, hint: str = "") -> GeometryError:
        return GeometryError(f"line {self.line}, *{self.keyword}: {message}", hint)

    def name(self, parameter: str) -> str:
        if not self.parameters.get(parameter):
            raise self.refuse(f"{parameter} is missing")
        return self.parameters[parameter]

    def known(self, sets: dict[str, list[int]], name: str) -> list[int]:
        if name not in sets:
            raise self.refuse(f'there is no set "{name}"')
        return sets[name]

    def whole(self, value: str) -> int:
        """A number of a node or an element."""
        if not value.isdecimal():
            raise self.refuse(f'"{value}" is not a number of a node or an element')
        return int(value)

    def real(self, value: str) -> float:
        """A number, 0 if empty, with the exponents of Fortran."""
        try:
            return float(re.sub("[dD]", "e", value) or 0.0)
        except ValueError as error:
            raise self.refuse(f'"{value}" is not a number') from error


class _Scope:
    """Nodes (3,) and elements (kind, nodes) by number, sets of numbers, and surfaces by name: numbers or sets
    of elements with the number of a side, from 0. ``listed`` sets only name a list of elements. New nodes
    move by ``rotation @ x + shift``."""

    def __init__(self) -> None:
        self.nodes: dict[int, FloatArray] = {}
        self.elements: dict[int, tuple[str, list[int]]] = {}
        self.node_sets: dict[str, list[int]] = {}
        self.element_sets: dict[str, list[int]] = {}
        self.surfaces: dict[str, list[tuple[str, int]]] = {}
        self.listed: set[str] = set()
        self.rotation, self.shift = np.eye(3), np.zeros(3)

    def add_nodes(self, section: _Section) -> None:
        numbers = []
        for label, *values in section.rows:
            number = section.whole(label)
            place = np.array([section.real(value) for value in (*values, "", "", "")[:3]])
            place = self.rotation @ place + self.shift
            if number in self.nodes and not np.array_equal(self.nodes[number], place, equal_nan=True):
                raise section.refuse(f"node {number} has been defined before, at another place")
            self.nodes[number] = place
            numbers.append(number)
        if "NSET" in section.parameters:
            self.node_sets.setdefault(section.name("NSET"), []).extend(numbers)

    def add_elements(self, section: _Section) -> None:
        """The elements of an *ELEMENT section; a row may go on in the next line."""
        name = section.name("TYPE").upper()
        kind = next((kind for kind, known in _TYPES.items() if re.fullmatch(known, name)), "")
        if not kind:
            hint = "plane triangles and quadrilaterals, and lines, only"
            raise section.refuse(f'there are elements of type "{name}"', hint)
        values = [section.whole(value) for row in section.rows for value in row if value]
        if len(values) % (_COUNTS[kind] + 1):
            raise section.refuse(f"elements of this type have {_COUNTS[kind]} nodes")
        table = np.array(values, dtype=np.int64).reshape(-1, _COUNTS[kind] + 1).tolist()
        for number, *nodes in table:
            if number in self.elements:
                raise section.refuse(f"element {number} has been defined before")
            absent = [node for node in nodes if node not in self.nodes]
            if absent:
                raise section.refuse(f"element {number} refers to node {absent[0]}, which is not in the file")
            # The mid-side node of lines is the second one here and the third one of meshio.
            self.elements[number] = kind, [nodes[0], nodes[2], nodes[1]] if kind == "line3" else nodes
        if "ELSET" in section.parameters:
            name = section.name("ELSET")
            self.listed |= {name} - self.element_sets.keys()
            self.element_sets.setdefault(name, []).extend(number for number, *_ in table)

    def add_set(self, section: _Section) -> None:
        """The set of an *NSET or *ELSET section; numbers of nothing are left out later."""
        nodes = section.keyword == "NSET"
        sets, name = (self.node_sets, "NSET") if nodes else (self.element_sets, "ELSET")
        members = sets.setdefault(section.name(name), [])
        if nodes and "ELSET" in section.parameters:
            for number in section.known(self.element_sets, section.name("ELSET")):
                members += self.elements[number][1]
        for row in section.rows:
            if "GENERATE" in section.parameters:
                first, last, *step = (section.whole(value) for value in row if value)
                members += range(first, last + 1, max(*step, 1) if step else 1)
                continue
            for value in filter(None, row):
                members += [int(value)] if value.isdecimal() else section.known(sets, value)
        if not nodes:
            self.listed.discard(section.name(name))

    def add_surface(self, section: _Section) -> None:
        """The sides of a *SURFACE section; other kinds of surfaces name no edges."""
        if section.parameters.get("TYPE", "ELEMENT").upper() == "ELEMENT":
            known = self.surfaces.setdefault(section.name("NAME"), [])
            for members, side, *_ in (row for row in section.rows if row[1:]):
                if re.fullmatch("[SEse][1-4]", side):
                    known.append((members, int(side[1]) - 1))

    def name_surfaces(self, surfaces: dict[str, list[tuple[str, int]]]) -> None:
        """Adds surfaces as sets of lines, but those with an edge of another surface, line or set of nodes."""
        # Ends and mid-side node, if there is one, of the sides that are here.
        edges: dict[str, list[tuple[int, ...]]] = {name: [] for name in surfaces}
        for name, members, side in ((name, *place) for name, places in surfaces.items() for place in places):
            numbers = [int(members)] if members.isdecimal() else self.element_sets.get(members, [])
            for kind, nodes in (self.elements[number] for number in numbers if number in self.elements):
                corners = 3 if kind.startswith("triangle") else 4
                if not kind.startswith("line") and side < corners:
                    middle = nodes[corners + side : corners + side + 1]
                    edges[name].append((nodes[side], nodes[(side + 1) % corners], *middle))
        counts = Counter(frozenset(edge[:2]) for listed in edges.values() for edge in set(listed))
        counts.update(frozenset(nodes[:2]) for kind, nodes in self.elements.values() if kind[:4] == "line")
        for name, listed in edges.items():
            taken = any(set(edge) <= set(nodes) for nodes in self.node_sets.values() for edge in listed)
            if taken or any(counts[frozenset(edge[:2])] > 1 for edge in listed):
                continue
            for number, edge in enumerate(dict.fromkeys(listed), max(self.elements, default=0) + 1):
                self.elements[number] = "line" if len(edge) == 2 else "line3", list(edge)
                self.element_sets.setdefault(name, []).append(number)


def read_abaqus(text: str) -> Grid:
    """The mesh of an input file. Programs name every list of elements: a line that is in a set too is not in
    its list. Raises GeometryError with the number of the line."""
    assembly, parts, instances = _Scope(), dict[str, _Scope](), dict[str, _Scope]()
    scope, title = assembly, ""
    for section in _sections(text):
        keyword = section.keyword
        if keyword in _REFUSED:
            raise section.refuse("this keyword is not supported", _REFUSED[keyword])
        if keyword in ("PART", "INSTANCE"):
            title = section.name("NAME")
            known = parts if keyword == "PART" else instances
            if title in known:
                raise section.refuse(f'the name "{title}" is used twice')
            known[title] = scope = _Scope() if keyword == "PART" else _placed(section, parts)
        elif keyword in ("ENDPART", "ENDINSTANCE"):
            scope = assembly
        elif keyword in ("NODE", "ELEMENT", "NSET", "ELSET"):
            if section.parameters.keys() & {"INPUT", "SYSTEM"}:
                raise section.refuse("INPUT and SYSTEM are not supported", "write all values in this file")
            target = _named(section, scope, instances)
            add = {"NODE": target.add_nodes, "ELEMENT": target.add_elements}.get(keyword, target.add_set)
            add(section)
        elif keyword == "SURFACE":
            scope.add_surface(section)
    return _merged({**(instances or parts), "": assembly})


def _sections(text: str) -> Iterator[_Section]:
    """The keywords of a file, without comments; every name as it is spelt first, as case does not matter."""
    section: _Section | None = None
    continued = False
    spelling: dict[str, str] = {}

    def spelt(value: str) -> str:
        value = value.strip().strip('"')
        return spelling.setdefault(value.upper(), value)

    for number, line in enumerate(map(str.strip, text.splitlines()), start=1):
        if not line or line.startswith("**"):
            continue
        values = line
        if line.startswith("*"):
            if section is not None:
                yield section
            keyword, _, values = line[1:].partition(",")
            section = _Section(number, re.sub(r"\s", "", keyword).upper(), {}, [])
        if section is None:
            continue
        if line.startswith("*") or continued:
            for name, value in re.findall(r'([^,=]+)(?:=\s*("[^"]*"|[^,]*))?', values):
                section.parameters[name.strip().upper()] = spelt(value)
            continued = line.endswith(",")
        elif section.keyword in ("NSET", "ELSET", "SURFACE"):
            section.rows.append([".".join(map(spelt, value.split("."))) for value in values.split(",")])
        else:
            section.rows.append([value.strip() for value in values.split(",")])
    if section is not None:
        yield section


def _named(section: _Section, scope: _Scope, instances: dict[str, _Scope]) -> _Scope:
    """The scope of a section: that of the instance it names, also as in Block-1.Left, or the present one."""
    wanted = section.parameters.get("INSTANCE", "")
    dotted = {value.rpartition(".")[0] for row in section.rows for value in row}
    if not wanted and len(dotted) == 1 and dotted <= instances.keys():
        (wanted,) = dotted
        section.rows[:] = [[value.rpartition(".")[2] for value in row] for row in section.rows]
    if wanted and wanted not in instances:
        raise section.refuse(f'there is no instance "{wanted}"')
    return instances.get(wanted, scope)


def _placed(section: _Section, parts: dict[str, _Scope]) -> _Scope:
    """The instance of a part, moved by the first data line, then turned as the second one tells."""
    wanted = section.name("PART")
    if wanted not in parts:
        raise section.refuse(f'there is no part "{wanted}"')
    rows = [[section.real(value) for value in row] for row in section.rows]
    shift = np.array((*(rows[0] if rows else ()), 0.0, 0.0, 0.0)[:3])
    rotation = np.eye(3)
    if len(rows) > 1:
        if len(rows[1]) < 7:
            raise section.refuse("a rotation has seven values: two points and an angle")
        start, end = np.array(rows[1][:3]), np.array(rows[1][3:6])
        # By the formula of Rodrigues.
        (x, y, z), angle = (end - start) / np.linalg.norm(end - start), np.radians(rows[1][6])
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        rotation = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
        shift = start + rotation @ (shift - start)
    instance = deepcopy(parts[wanted])
    instance.nodes = {number: rotation @ node + shift for number, node in instance.nodes.items()}
    instance.rotation, instance.shift = rotation, shift
    return instance


def _merged(scopes: dict[str, _Scope]) -> Grid:
    """The mesh of all scopes: a block of elements for each of them and each kind of element."""
    points: list[FloatArray] = []
    blocks: list[tuple[str, IntArray, list[list[str]]]] = []
    node_sets: dict[str, list[int]] = {}
    for title, scope in scopes.items():
        scope.name_surfaces({**scopes[""].surfaces, **scope.surfaces})
        row = {number: len(points) + k for k, number in enumerate(scope.nodes)}
        points += scope.nodes.values()
        for name, numbers in scope.node_sets.items():
            node_sets.setdefault(name, []).extend(row[number] for number in numbers if number in row)
        lines = {number for number, (kind, _) in scope.elements.items() if kind.startswith("line")}
        sets = {name: numbers for name, numbers in scope.element_sets.items() if name not in scope.listed}
        named = lines & {number for numbers in sets.values() for number in numbers}
        # An instance is a group of faces; lines are in one group at most.
        faces = {title: list(scope.elements.keys() - lines)} if title else {}
        groups: dict[int, list[str]] = {number: [] for number in scope.elements}
        for name, numbers in (*scope.element_sets.items(), *faces.items()):
            for number in groups.keys() & numbers:
                if name not in scope.listed or number not in named:
                    groups[number].append(name)
        for kind in dict.fromkeys(kind for kind, _ in scope.elements.values()):
            chosen = [number for number, element in scope.elements.items() if element[0] == kind]
            cells = [[row[node] for node in scope.elements[number][1]] for number in chosen]
            blocks.append((kind, np.array(cells, dtype=np.int64), [groups[number] for number in chosen]))
    sets_of_rows = {name: np.unique(np.array(rows, dtype=np.int64)) for name, rows in node_sets.items()}
    return np.array(points).reshape(-1, 3), blocks, sets_of_rows
