"""What a scene is: a case as a user writes it, and the figures by which its result is judged."""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import shutil
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import h5py
import meshio
import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import formulas

Array = NDArray[np.float64]
Table = dict[str, Any]
Move = Callable[[Array], Array]
"""Places (n, 2) of a scene to those of a variant."""

FORCE, PEAK, PLACE = 1.0, 3.0, 3.0
"""Limits in percent of forces, peak pressures and displacements."""
LIMITS = {"force": FORCE, "peak": PEAK, "moved": PLACE, "apart": PLACE}
CASES = Path(__file__).parent / "cases"


@dataclass(frozen=True)
class Result:
    """What a run gives: summary.json, and its directory."""

    summary: Table
    folder: Path

    @cached_property
    def case(self) -> Table:
        return tomllib.loads((self.folder.parent / "case.toml").read_text())

    def read(self, path: str) -> Any:
        """An array of run.h5."""
        with h5py.File(self.folder / "run.h5") as file:
            return file[path][:]

    def force(self, contact: str) -> Array:
        """Force (2,) on the slave."""
        return np.array(self.summary["contacts"][contact]["force"])

    def peak(self, contact: str) -> float:
        return float(self.summary["contacts"][contact]["peak_pressure"])

    def half_width(self, contact: str) -> float:
        return float(self.summary["contacts"][contact]["half_width"])

    def last(self, contact: str, key: str) -> Array:
        """Values (n,) of a contact in the last state."""
        return np.asarray(self.read(f"contacts/{contact}/{key}")[-1])

    def pressed(self, contact: str) -> float:
        """Integral of the pressure."""
        return float(self.last(contact, "pressure") @ self.read(f"contacts/{contact}/weight"))

    def size(self, contact: str) -> float:
        """Integral of the size of pressure and traction."""
        size = np.hypot(self.last(contact, "pressure"), self.last(contact, "traction"))
        return float(size @ self.read(f"contacts/{contact}/weight"))

    def along(self, contact: str, key: str, x: float) -> float:
        """A value of a contact in the last state, interpolated at ``x``."""
        places = self.read(f"contacts/{contact}/points")[:, 0]
        order = np.argsort(places)
        return float(np.interp(x, places[order], self.last(contact, key)[order]))

    def touching(self, contact: str) -> Array:
        """First and last ``x`` (2,) under pressure."""
        x = self.read(f"contacts/{contact}/points")[self.last(contact, "pressure") > 0.0, 0]
        return np.array([x.min(), x.max()])

    def stick(self, contact: str) -> Array:
        """First and last ``x`` (2,) that stick."""
        x = self.read(f"contacts/{contact}/points")[self.last(contact, "status") == 1, 0]
        return np.array([x.min(), x.max()])

    def dissipated(self, contact: str, position: float = np.inf) -> float:
        """Dissipated work up to a position of the path."""
        before = np.flatnonzero(self.read("path/position") <= position + 1e-9)
        return float(self.read(f"contacts/{contact}/dissipated_work")[before[-1]])

    def patches(self, contact: str) -> int:
        """Connected parts that touch in the last state."""
        pressure = self.last(contact, "pressure")
        closed = np.concatenate([[False], pressure > 1e-3 * pressure.max(), [False]])
        return int((closed[1:] & ~closed[:-1]).sum())

    def moved(self, probe: str) -> Array:
        """Displacement (2,) of a probe."""
        return np.array(self.summary["probes"][probe]["displacement"])

    def stress(self, probe: str) -> Array:
        return np.array(self.summary["probes"][probe]["stress"])

    def lean(self, upper: str, lower: str, contact: str) -> float:
        """Slope of a force over that of the line of two displaced probes."""
        drawn = {one["name"]: np.array(one["point"]) for one in self.case["probe"]}
        line = drawn[upper] + self.moved(upper) - drawn[lower] - self.moved(lower)
        force = self.force(contact)
        return abs(float(force[0] / force[1] * line[1] / line[0]))

    def exerted(self, name: str) -> Array:
        """Force (2,) of a load or support on its body."""
        return np.array(self.summary["forces"][name])

    def moment(self, plate: str) -> float:
        return float(self.summary["plates"][plate]["moment"])

    def bifurcation(self) -> float:
        """Position of the first loss of stability."""
        return float(self.summary["finite_strain"]["bifurcations"][0]["position"])


@dataclass(frozen=True)
class Figure:
    """One figure of a result, its true value, and by how many percent it may be off."""

    what: str
    got: Callable[[Result], float]
    true: float
    limit: float = FORCE
    scale: float | None = None
    """What the error is relative to, for values that may be zero; by default the true value."""

    def error(self, got: float) -> float:
        """In percent."""
        return 100.0 * (got - self.true) / (self.scale or abs(self.true))


@dataclass(frozen=True)
class Refusal:
    """That a scene has no equilibrium beyond a position on its path, and words that must tell so.

    Without a position the words are to be told in any case, as a warning or as an error.
    """

    words: Sequence[str]
    position: float | None
    limit: float = 2.0


@dataclass(frozen=True)
class Scene:
    """A case, judged. ``files`` are the meshes that it names."""

    name: str
    kind: str
    case: Table
    figures: Sequence[Figure] = ()
    refusal: Refusal | None = None
    files: Sequence[Path] = ()
    elements: bool = False
    supports: Sequence[Table] = ()
    straight_walls: bool = False
    limits: Mapping[str, float] = field(default_factory=lambda: LIMITS)
    """Percent that figures of finite elements may be off, by the first words of their names."""


def computed(text: str, names: Mapping[str, Any]) -> float:
    """An expression of expected.toml, of formulas and of ``names``."""
    known = {**vars(math), **vars(formulas), **names, "abs": abs, "sum": sum, "range": range}
    return float(eval(text, known | {"__builtins__": {}}))


def _figure(row: Table) -> Figure:
    def got(result: Result) -> float:
        methods = {name: getattr(result, name) for name in vars(Result) if not name.startswith("_")}
        return computed(row["got"], methods)

    more = {key: row[key] for key in ("limit", "scale") if key in row}
    return Figure(row["what"], got, computed(row["true"], {}), **more)


def plain(path: Path) -> Scene:
    """A case without anything to judge it by."""
    given = case_of(path)
    files = [path.parent / one["shape"]["file"] for one in given["body"] if "file" in one["shape"]]
    return Scene(path.stem, "", given, files=files)


@cache
def scene(name: str) -> Scene:
    """The scene of a name in cases/, with what expected.toml tells."""
    told = expected()[name]
    refusal = told.get("refusal")
    if refusal:
        refusal = Refusal(**{**refusal, "position": computed(refusal["position"], {})})
    return replace(
        plain(CASES / f"{name}.toml"),
        name=name,
        kind=told["class"],
        figures=[_figure(row) for row in told.get("figures", ())],
        refusal=refusal,
        **{key: told[key] for key in ("elements", "supports", "straight_walls", "limits") if key in told},
    )


def names(folder: str = ".") -> list[str]:
    """Names of the scenes in a folder of cases/."""
    return [name for name in expected() if str(Path(name).parent) == folder]


@cache
def expected() -> dict[str, Table]:
    """What expected.toml tells of every scene."""
    return tomllib.loads(Path(__file__).with_name("expected.toml").read_text())


def case_of(path: Path) -> Table:
    return tomllib.loads(path.read_text())


def write_mesh(source: Path, path: Path, move: Move | None) -> None:
    """A copy of a mesh file, its places moved."""
    if move is None:
        shutil.copy(source, path)
        return
    with contextlib.redirect_stdout(io.StringIO()):  # meshio prints an empty line
        mesh = meshio.read(source)
    mesh.points[:, :2] = move(mesh.points[:, :2])
    meshio.write(path, mesh, file_format="gmsh22", binary=False)


def listed(boundaries: str | list[str]) -> list[str]:
    """One boundary, or several, as a list."""
    return [boundaries] if isinstance(boundaries, str) else boundaries


def options(doc: str | None) -> argparse.ArgumentParser:
    """A parser whose help is ``doc``, with parts of names of scenes as ``--only``."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    return parser
