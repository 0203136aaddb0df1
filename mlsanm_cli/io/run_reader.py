"""Reader of run.h5 into frozen values; also for runs that were killed or are still being written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_dir import RUN_FILE
from mlsanm_cli.io.run_file import FORMAT
from mlsanm_cli.io.schema import CONTACT_HISTORY
from mlsanm_cli.io.summary import items_of, path_table

MAX_LISTED = 5
"""Largest number of directories listed in a hint."""
MAPS = ("forces", "slip", "probes", "bonds")
PATH: tuple[tuple[str, type[np.generic]], ...] = (
    *((name, np.float64) for name in ("position", "step_length", "residual", "seconds")),
    *((name, np.int64) for name in ("order", "factorizations", "solves")),
)
"""Columns of /path and their types."""
NAMED = ("factors", "resultants", "displacements")
"""Columns of /path by load, or by load or support."""

Read = TypeVar("Read")


@dataclass(frozen=True)
class BodyData:
    """Undeformed points (n, 2); indices (nb,), outward normals (nb, 2) and boundary names (nb,) of the
    boundary nodes; and the degree of the local polynomials, None if it is not stored."""

    points: FloatArray
    boundary_index: IntArray
    boundary_normal: FloatArray
    boundary_name: tuple[str, ...]
    degree: int | None = None


@dataclass(frozen=True)
class PathData:
    """The load path, one row per finished step and row 0 for the start: arrays (S+1,), resultants and
    displacements (S+1, 2)."""

    position: FloatArray
    step_length: FloatArray
    residual: FloatArray
    order: IntArray
    factorizations: IntArray
    solves: IntArray
    seconds: FloatArray
    factors: Mapping[str, FloatArray]
    resultants: Mapping[str, FloatArray]
    displacements: Mapping[str, FloatArray]

    @property
    def rows(self) -> int:
        """Number of rows, S+1; 0 if the run ended before its first state."""
        return len(self.position)


@dataclass(frozen=True)
class ContactData:
    """One contact: slave nodes (m, 2), normal (m, 2), arc_length, weight (m,); history (S+1, m) or (S+1,)."""

    points: FloatArray
    normal: FloatArray
    arc_length: FloatArray
    weight: FloatArray
    pressure: FloatArray
    traction: FloatArray
    gap: FloatArray
    slip: FloatArray
    status: NDArray[np.int8]
    dissipated_work: FloatArray


@dataclass(frozen=True)
class ProbeData:
    """Displacement (S+1, 2), stress (S+1, 3) and von Mises stress (S+1,) at a probe."""

    displacement: FloatArray
    stress: FloatArray
    von_mises: FloatArray


@dataclass(frozen=True)
class SavedState:
    """Fields saved at one position: body name -> field name -> array (n,), (n, 2) or (n, 3)."""

    position: float
    bodies: Mapping[str, Mapping[str, FloatArray]]


@dataclass(frozen=True)
class RunHead:
    """The attributes of a run, and its case as given and resolved, as TOML."""

    attributes: Mapping[str, str | int | float]
    case_raw: str
    case_resolved: str

    @property
    def status(self) -> str:
        """running (or killed), done, failed or stopped."""
        return str(self.attributes["status"])


@dataclass(frozen=True)
class RunData(RunHead):
    """A run as read from its directory; mappings keep the order of the case. ``maps[kind][name]`` (r, 1 + u)
    map 1 and the unknowns of the path (load factors, motions, pressures and tractions) to forces, slips or
    the values of a probe; only runs with power series have them."""

    directory: Path
    bodies: Mapping[str, BodyData]
    path: PathData
    contacts: Mapping[str, ContactData]
    states: tuple[SavedState, ...]
    probes: Mapping[str, ProbeData]
    maps: Mapping[str, Mapping[str, FloatArray]]

    @property
    def is_finite(self) -> bool:
        """Whether the run is at finite strain, where states between two rows cannot be evaluated."""
        return self.attributes.get("strain") == "finite"

    @property
    def unilateral_contacts(self) -> tuple[str, ...]:
        """The contacts that are not bonded."""
        return tuple(name for name in self.contacts if name not in self.maps["bonds"])


@dataclass(frozen=True)
class RunOrigin(RunHead):
    """The origin of a run: its seconds and rows so far, and the checkpoint from which it continues: texts,
    arrays, and mappings of them by name."""

    seconds: float
    rows: int
    checkpoint: Mapping[str, Any]


def read_run(rundir: Path) -> RunData:
    """Reads the run in directory ``rundir`` (or from the run.h5 itself), also one in progress. Raises
    RunError if there is no run, if run.h5 is damaged or not from mlsanm, or if it has another format."""
    return _reading(rundir, _run)


def read_origin(rundir: Path) -> RunOrigin:
    """Reads the origin of the run in ``rundir``. Raises RunError as `read_run` does."""
    return _reading(rundir, _origin)


def read_path(rundir: Path) -> Mapping[str, NDArray[Any]]:
    """Reads the columns of path.csv, also of a run in progress. Raises RunError as `read_run` does."""
    return _reading(rundir, lambda root, file: path_table(root))


def read_series(rundir: Path, step: int) -> tuple[Mapping[str, FloatArray], Mapping[str, Any]]:
    """Reads the arrays and attributes of the series of ``step``, both empty if it has none. Raises RunError
    as `read_run` does."""

    def read(root: Any, file: Path) -> tuple[Mapping[str, FloatArray], Mapping[str, Any]]:
        found = dict(items_of(root, f"series/{step}"))
        return _tree(found), dict(root[f"series/{step}"].attrs) if found else {}

    return _reading(rundir, read)


def _reading(rundir: Path, read: Callable[[Any, Path], Read]) -> Read:
    """The result of ``read`` on the open run.h5."""
    file = rundir if rundir.is_file() else rundir / RUN_FILE
    if not file.is_file():
        what = "no such directory" if not rundir.exists() else f"it holds no {RUN_FILE}"
        inside = sorted(path.parent for path in rundir.glob(f"*/{RUN_FILE}"))
        hint = "give the directory written by `mlsanm run`"
        if inside:
            more = ", ..." if len(inside) > MAX_LISTED else ""
            hint = f"there are runs in it: {', '.join(map(str, inside[:MAX_LISTED]))}{more}"
        raise RunError(f"{rundir} is not a run: {what}", hint)
    try:
        # Needs no lock, as the writer replaces the file as a whole.
        with h5py.File(file, "r", locking=False) as root:
            return read(root, file)
    except PermissionError as error:
        raise RunError(f"{file} cannot be read: {error.strerror}") from error
    except (OSError, KeyError, ValueError, RuntimeError, TypeError, AttributeError) as error:
        # TypeError, AttributeError: a damaged dataset may have no shape, or be None.
        raise RunError(
            f"{file} cannot be read: it is damaged ({error})", hint="run the case again with --force"
        ) from error


def _head(root: Any, file: Path) -> dict[str, Any]:
    attributes = {name: _scalar(value) for name, value in root.attrs.items()}
    if "mlsanm_version" not in attributes or "status" not in attributes:
        raise RunError(f"{file} was not written by mlsanm", hint="give the directory of a run")
    if attributes.get("format") != FORMAT:
        raise RunError(
            f"{file} has format {attributes.get('format')}, this version reads format {FORMAT}",
            hint=f"it was written by mlsanm {attributes['mlsanm_version']}",
        )
    texts = {name: _text(root, name.replace("_", "/")) for name in ("case_raw", "case_resolved")}
    return {"attributes": attributes, **texts}


def _origin(root: Any, file: Path) -> RunOrigin:
    seconds = root["path/seconds"][-1:] if "path/seconds" in root else np.zeros(0)
    return RunOrigin(
        **_head(root, file),
        seconds=float(seconds.sum()),
        rows=len(root["path/position"]) if "path" in root else 0,
        checkpoint=_tree(root["checkpoint"]) if "checkpoint" in root else {},
    )


def _run(root: Any, file: Path) -> RunData:
    return RunData(
        **_head(root, file),
        directory=file.parent,
        bodies={name: _body(group) for name, group in items_of(root, "bodies")},
        path=_path(root),
        contacts={name: _contact(group) for name, group in items_of(root, "contacts")},
        states=_states(root),
        probes={name: ProbeData(**_tree(group)) for name, group in items_of(root, "probes")},
        maps={kind: _tree(dict(items_of(root, f"maps/{kind}"))) for kind in MAPS},
    )


def _path(root: Any) -> PathData:
    """The path, without rows for a run without a first state."""
    columns: dict[str, Any] = {
        key: root[f"path/{key}"][...] if "path" in root else np.empty(0, kind) for key, kind in PATH
    }
    named: dict[str, Any] = {key: _tree(dict(items_of(root, f"path/{key}"))) for key in NAMED}
    return PathData(**columns, **named)


def _contact(group: Any) -> ContactData:
    found = _tree(group)
    count = len(found["points"])
    sizes = {"step": 0, "contact_node": count}
    history = {one.name: np.empty(one.shape(sizes), one.dtype) for one in CONTACT_HISTORY}
    return ContactData(**{**history, **found})


def _states(root: Any) -> tuple[SavedState, ...]:
    positions = root["fields/position"][...].tolist() if "fields" in root else []
    return tuple(
        SavedState(position, _tree(root[f"fields/{index}"])) for index, position in enumerate(positions)
    )


def _body(group: Any) -> BodyData:
    boundary = group["boundary"]
    return BodyData(
        points=group["points"][...],
        boundary_index=boundary["index"][...],
        boundary_normal=boundary["normal"][...],
        boundary_name=tuple(boundary["name"].asstr()[...].tolist()),
        degree=int(group["degree"][()]) if "degree" in group else None,
    )


def _tree(group: Any) -> dict[str, Any]:
    """The content of a group: groups as mappings, texts, arrays."""
    return {name: _tree(item) if hasattr(item, "items") else _value(item) for name, item in group.items()}


def _value(item: Any) -> Any:
    return item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[...]


def _text(root: Any, path: str) -> str:
    return str(root[path].asstr()[()]) if path in root else ""


def _scalar(value: Any) -> str | int | float:
    """An attribute as a plain Python value."""
    plain = value.item() if isinstance(value, np.generic) else value
    return plain if isinstance(plain, str | int | float) else str(plain)
