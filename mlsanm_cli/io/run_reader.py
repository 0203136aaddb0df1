"""Reader of run.h5 as one dataset, described by `io.schema`; also of runs killed or being written."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import schema
from mlsanm_cli.io.files import check_seal, read_summary
from mlsanm_cli.io.run_dir import RUN_FILE, SUMMARY_FILE
from mlsanm_cli.io.schema import path_table

FORMAT = 1
RESULTS = ("bodies", "path", "contacts", "probes", "maps", "fields")
"""The groups that are read by default; series and the checkpoint are read when they are needed."""


class Dataset(Mapping[str, Any]):
    """A group of run.h5, with members by path, ``run["contacts/nose/gap"]``, or as attributes,
    ``run.contacts["nose"].gap``, in the order of the case; ``attributes`` are those of the group."""

    def __init__(self, members: Mapping[str, Any], attributes: Mapping[str, Any] | None = None) -> None:
        self._members = {
            name: Dataset(member) if isinstance(member, dict) else member for name, member in members.items()
        }
        self.attributes = dict(attributes or {})

    def __getitem__(self, path: str) -> Any:
        name, _, rest = path.partition("/")
        return self._members[name][rest] if rest else self._members[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._members:
            raise AttributeError(f"there is no {name!r} in this group")
        return self._members[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)


class SavedState(NamedTuple):
    """Fields (n, ...) saved at one position, by body and name."""

    position: float
    bodies: Dataset


class RunData(Dataset):
    """A run as read from its ``directory``. ``status`` is running (or killed), done, failed or stopped;
    ``rows`` those of the path, S+1, 0 if the run ended before its first state; ``seconds`` those that they
    took, of all processes; at finite strain states between two rows cannot be evaluated."""

    def __init__(self, directory: Path, members: Mapping[str, Any], attributes: Mapping[str, Any]) -> None:
        super().__init__(members, attributes)
        self.directory, self.status = directory, str(attributes["status"])
        self.case_raw, self.case_resolved = (str(self.get(f"case/{key}", "")) for key in ("raw", "resolved"))
        self.rows = len(self.get("path/position", ()))
        self.seconds = float(sum(self.get("path/seconds", np.empty(0))[-1:]))
        self.is_finite = attributes.get("strain") == "finite"

    @property
    def unilateral_contacts(self) -> tuple[str, ...]:
        """The contacts that are not bonded."""
        return tuple(name for name in self["contacts"] if name not in self["maps/bonds"])

    @property
    def states(self) -> tuple[SavedState, ...]:
        """The saved states."""
        positions = self.get("fields/position", np.empty(0)).tolist()
        return tuple(SavedState(position, self[f"fields/{k}"]) for k, position in enumerate(positions))


def read_run(rundir: Path, groups: Sequence[str] = RESULTS) -> RunData:
    """Reads the case and ``groups`` of a run, given its directory or run.h5, also while it is written. Raises
    RunError if there is none, if run.h5 is damaged, not from mlsanm, or of another format."""
    with _opened(rundir) as (root, file):
        attributes: dict[str, str | int | float] = {}
        for name, value in root.attrs.items():
            plain = value.item() if isinstance(value, np.generic) else value
            attributes[name] = plain if isinstance(plain, str | int | float) else str(plain)
        if "mlsanm_version" not in attributes or "status" not in attributes:
            raise RunError(f"{file} was not written by mlsanm", hint="give the directory of a run")
        if attributes.get("format") != FORMAT:
            message = f"{file} has format {attributes.get('format')}, this version reads format {FORMAT}"
            raise RunError(message, f"it was written by mlsanm {attributes['mlsanm_version']}")
        members = {name: _tree(root[name]) if name in root else {} for name in ("case", *groups)}
        return RunData(file.parent, _completed(members), attributes)


def read_origin(rundir: Path) -> RunData:
    """Reads the case, path and checkpoint of a run. Raises RunError as `read_run` does."""
    return read_run(rundir, ("path", "checkpoint"))


def held_run(directory: Path) -> tuple[str | None, Mapping[str, Any] | None]:
    """The hash of the case of a run, None without one, and its summary if this version has completed it."""
    try:
        known = read_origin(directory).attributes
    except RunError:
        return None, None
    held = str(known.get("case_hash", ""))
    with suppress(RunError):
        if known.get("mlsanm") == __version__ and known.get("status") == "done":
            summary = read_summary(directory / SUMMARY_FILE)
            return held, summary if summary.get("status") == "done" else None
    return held, None


def read_path(rundir: Path) -> Mapping[str, NDArray[Any]]:
    """Reads the columns of path.csv, also of a run in progress. Raises RunError as `read_run` does."""
    return path_table(dict(flat(read_run(rundir, ("path", "contacts")))))


def read_series(rundir: Path, step: int) -> Dataset:
    """Reads the series of ``step``, empty if it has none. Raises RunError as `read_run` does."""
    with _opened(rundir) as (root, _):
        group = root.get(f"series/{step}")
        return Dataset({}) if group is None else Dataset(_tree(group), group.attrs)


@contextmanager
def _opened(rundir: Path) -> Iterator[tuple[Any, Path]]:
    file = rundir if rundir.is_file() else rundir / RUN_FILE
    if not file.is_file():
        what = "no such directory" if not rundir.exists() else f"it holds no {RUN_FILE}"
        inside = [str(path.parent) for path in sorted(rundir.glob(f"*/{RUN_FILE}"))]
        listed = ", ".join([*inside[:5], *(["..."] if len(inside) > 5 else [])])
        hint = f"there are runs in it: {listed}" if inside else "give the directory written by `mlsanm run`"
        raise RunError(f"{rundir} is not a run: {what}", hint)
    try:
        check_seal(file)
        # Needs no lock, as the writer replaces the file as a whole.
        with h5py.File(file, "r", locking=False) as root:
            yield root, file
    except PermissionError as error:
        raise RunError(f"{file} cannot be read: {error.strerror}") from error
    except (OSError, LookupError, ValueError, RuntimeError, TypeError, AttributeError, MemoryError) as error:
        # A damaged dataset may have no shape, be None, or claim to be too large for the memory.
        message = f"{file} cannot be read: it is damaged ({error})"
        raise RunError(message, hint="run the case again with --force") from error


def _completed(members: dict[str, Any]) -> dict[str, Any]:
    """Members with groups and histories that runs without a state lack. Raises KeyError for others."""
    for entry in (*schema.NAMED_PATH, *schema.MAPS):
        group, kind, _ = entry.path.split("/")
        if group in members:
            members[group].setdefault(kind, {})
    path = members.get("path", {})
    if not any(isinstance(column, np.ndarray) for column in path.values()):
        path |= {entry.name: np.empty(0, entry.dtype) for entry in schema.PATH}
    for contact in members.get("contacts", {}).values():
        sizes = {"step": 0, "contact_node": len(contact["points"])}
        for entry in schema.CONTACT_HISTORY:
            contact.setdefault(entry.name, np.empty(entry.shape(sizes), entry.dtype))
    # The hoop stress is that of bodies of revolution only.
    probes = [entry for entry in schema.PROBES if entry.name != "stress_zz"]
    for entry in (*schema.BODIES, *schema.CONTACT_GEOMETRY, *probes):
        kind, _, name = re.split(r"/(\{\w+\})/", entry.path)
        for group in members.get(kind, {}).values():
            Dataset(group)[name]
    return members


def _tree(group: Any) -> dict[str, Any]:
    """The content of a group: groups as mappings, texts, lists of texts, arrays."""
    return {name: _tree(item) if hasattr(item, "items") else read_value(item) for name, item in group.items()}


def flat(group: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """The datasets of a group by path, in their order."""
    for name, item in group.items():
        if hasattr(item, "items"):
            yield from flat(item, f"{above}{name}/")
        else:
            yield f"{above}{name}", item


def read_value(item: Any) -> Any:
    """The content of a dataset: an array, a text, or texts."""
    if not h5py.check_string_dtype(item.dtype):
        return item[...]
    text = item.asstr()[()]
    return text.tolist() if isinstance(text, np.ndarray) else str(text)
