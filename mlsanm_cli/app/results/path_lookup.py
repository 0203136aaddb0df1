"""A stored run at any position of its path, and the estimated error of interpolated values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.geometry.profile import unrolled
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import Dataset, RunData, read_series
from mlsanm_cli.io.schema import force_on_slave
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF, ROUND_OFF

STORED, SERIES, LINEAR, INTERPOLATED = "stored", "series", "linear", "interpolated"
MAX_ERROR = 0.25
"""Largest estimated error of interpolated values, relative to the largest of the two states."""
EDGE = 0.5
"""Errors shrink like this power of the distance of the states: pressures grow like the root of the distance
from an edge of contact, which moves with the load (Hertz: 0.120 of the peak there, 0.117 estimated)."""


@dataclass(frozen=True)
class Level:
    """A position of a path, with the values there by their path in run.h5. ``how`` they are known: stored in
    ``row``; from the power ``series`` of the step that ends there; or as a mean of that row, with the weight
    ``share``, and the one before: exact without unilateral contact or with constant factors, else
    "interpolated"."""

    run: RunData
    position: float
    how: str
    row: int
    share: float
    series: Mapping[str, FloatArray]

    def __getitem__(self, path: str) -> FloatArray:
        """A quantity from its history (S+1, ...)."""
        if self.how == SERIES and not path.startswith("path/factors/"):
            return self.series[path]
        return self.between(self.run[path])

    def between(self, history: FloatArray) -> FloatArray:
        """A history (S+1, ...) at this level, linear between rows."""
        row = np.asarray(history[self.row], dtype=np.float64)
        if self.how == STORED or history.dtype.kind == "i":
            return row
        return np.asarray(self.share * row + (1.0 - self.share) * history[self.row - 1])

    @property
    def factors(self) -> FloatArray:
        """Load factors (L,), which are linear within a stage."""
        return np.array([self.between(history) for history in self.run["path/factors"].values()])


def level_at(run: RunData, position: float) -> Level:
    """The level of a path position. Raises RunError beyond the path, and between states at finite strain."""
    rows = run["path/position"]
    if not len(rows):
        raise RunError(f"{run.directory} holds no finished step yet")
    # Not relative to the requested position, which may be infinite.
    slack = FINE_ROUND_OFF * max(float(rows[-1]), 1.0)
    last = float(rows.max())
    if not rows[0] - slack <= position <= last + slack:
        message = f"the path does not reach position {position:g}: it goes from {rows[0]:g} to {last:g}"
        hint = "a position is the number of completed stages plus the fraction of the current one"
        raise RunError(message, hint)
    same = np.flatnonzero(np.abs(rows - position) <= slack)
    if len(same):
        row = int(same[0])
        return Level(run, float(rows[row]), STORED, row, 1.0, {})
    row = int(np.flatnonzero(rows > position)[0])
    if run.is_finite:
        raise RunError(
            f"nothing is stored between positions {rows[row - 1]:.6g} and {rows[row]:.6g}, "
            "and results at finite strain are not interpolated",
            f"run again with {position:g} in output.at",
        )
    share = float((position - rows[row - 1]) / (rows[row] - rows[row - 1]))
    level = Level(run, position, LINEAR, row, share, {})
    stored = read_series(run.directory, row)
    if stored:
        return replace(level, how=SERIES, series=_from_series(run, level, stored))
    changes = any(history[row] != history[row - 1] for history in run["path/factors"].values())
    return replace(level, how=INTERPOLATED) if run.unilateral_contacts and changes else level


def _from_series(run: RunData, level: Level, stored: Dataset) -> dict[str, FloatArray]:
    """The values at a level by their paths, from the series of its step and the maps of the run."""
    names = [name for name in ("pressure", "gap", "motion", "traction") if name in stored]
    parts = [stored[name] for name in names]
    length = float(stored.attributes["length"])
    branch = Branch(np.hstack(parts), stored.position, length, stored.get("denominator"))
    x, _ = branch.evaluate(branch.parameter_at(level.position))
    split = np.split(x, np.cumsum([part.shape[1] for part in parts])[:-1])
    none = dict.fromkeys(("motion", "traction"), np.zeros(0))
    known = none | dict(zip(names, split, strict=True))
    unknowns = np.concatenate([[1.0], level.factors, known["motion"], known["pressure"], known["traction"]])
    maps = {
        kind: {name: matrix @ unknowns for name, matrix in own.items()} for kind, own in run["maps"].items()
    }
    values = {f"path/resultants/{name}": force for name, force in maps["forces"].items()}
    for name, both in maps["probes"].items():
        values |= {f"probes/{name}/displacement": both[:2], f"probes/{name}/stress": both[2:]}
    pressed = pulled = 0
    for name, contact in run["contacts"].items():
        count = len(contact.arc_length)
        found = {"status": contact.status[level.row], "traction": np.zeros(count)}
        if name in maps["bonds"]:
            found |= dict(zip(("pressure", "traction"), np.split(maps["bonds"][name], 2), strict=True))
            found |= dict.fromkeys(("gap", "slip"), np.zeros(count))
        else:
            found |= {key: known[key][pressed : pressed + count] for key in ("pressure", "gap")}
            pressed += count
        if name in maps["slip"]:
            found |= {"traction": known["traction"][pulled : pulled + count], "slip": maps["slip"][name]}
            pulled += count
        values |= {f"contacts/{name}/{key}": value for key, value in found.items()}
    return values


def displacement_at(run: RunData, level: Level, body: str) -> tuple[FloatArray, str]:
    """Nodal displacements (n, 2) of a body at a level, and their origin: saved, or without unilateral contact
    superposed from saved states whose load factors combine to those of the level. Raises RunError."""
    saved = [state for state in run.states if "displacement" in state.bodies[body]]
    if not saved:
        hint = 'add "displacement" to output.fields, or a [[probe]] at the point'
        raise RunError(f"{run.directory} holds no displacement fields", hint)
    for state in saved:
        if abs(state.position - level.position) <= FINE_ROUND_OFF * max(abs(level.position), 1.0):
            return state.bodies[body].displacement, STORED
    if not run.unilateral_contacts and not run.is_finite:
        known = np.array([level_at(run, state.position).factors for state in saved])
        shares = np.linalg.lstsq(known.T, level.factors, rcond=None)[0]
        missed = np.abs(shares @ known - level.factors).max(initial=0.0)
        if missed <= ROUND_OFF * max(np.abs(level.factors).max(initial=0.0), 1.0):
            fields = np.array([state.bodies[body].displacement for state in saved])
            return np.asarray(np.einsum("s,snd->nd", shares, fields), dtype=np.float64), LINEAR
    places = ", ".join(f"{state.position:g}" for state in saved)
    message = f"fields are saved at position {places} only, not at {level.position:g}"
    hint = f"run again with {level.position:g} in output.at, or with a [[probe]] at the point"
    raise RunError(message, hint)


def checked_error(run: RunData, level: Level, name: str, *histories: FloatArray) -> float | None:
    """The estimated error of interpolated ``histories`` (S+1, ...) over the largest value of the first; None
    if the level is not interpolated. Raises RunError if it is too large or unknown. It is that of adjacent
    rows, interpolated from their neighbours in the same stage, times a power of the ratio of distances."""
    if level.how != INTERPOLATED:
        return None
    position, row, share = run["path/position"], level.row, level.share
    gap = position[row] - position[row - 1]
    worst = 0.0
    for history in histories:
        errors = []
        for middle in (row - 1, row):
            if not 1 <= middle < len(position) - 1:
                continue
            before, after = np.diff(position[middle - 1 : middle + 2])
            of_stage = np.ceil(position[middle : middle + 2] - FINE_ROUND_OFF)
            if of_stage[0] == of_stage[1] and before > 0.0 and after > 0.0:
                first, stored, last = np.asarray(history[middle - 1 : middle + 2], dtype=np.float64)
                part = before / (before + after)
                missed = np.abs((1.0 - part) * first + part * last - stored).max(initial=0.0)
                finer = share * (1.0 - share) * gap**2 / (before * after)
                errors.append(float(finer ** (0.5 * EDGE) * missed))
        worst = max(worst, max(errors, default=np.inf))
    largest = float(np.abs(np.asarray(histories[0])[row - 1 : row + 1]).max(initial=0.0))
    error = worst / largest if worst else 0.0
    if error > MAX_ERROR:
        raise RunError(
            f"nothing is stored between positions {position[row - 1]:.6g} and {position[row]:.6g}, "
            f"which are too far apart to interpolate {name}",
            f"run again with {level.position:g} in output.at, or with power series (law hyperbolic, method "
            f"anm), which give results everywhere",
        )
    return error


def pressures_at(run: RunData, position: float) -> dict[str, FloatArray]:
    """Pressure (m,) of every contact at a path position. Raises RunError where they are not known."""
    level = level_at(run, position)
    for contact in run.contacts.values():
        checked_error(run, level, "pressures", contact.pressure)
    return {name: level[f"contacts/{name}/pressure"] for name in run.contacts}


def along_surface(contact: Dataset, pressure: FloatArray) -> tuple[IntArray, FloatArray]:
    """The nodes (m,) of a contact in drawn order and their arc lengths, on a closed surface from where
    pressures (m,) are furthest. One of six nodes or more is closed if its ends are within 1.5 spacings."""
    arc, step = contact.arc_length, float(np.hypot(*(contact.points[-1] - contact.points[0])))
    if len(arc) < 6 or step > 1.5 * float(np.diff(arc).max()) or 6 * step > arc[-1] - arc[0]:
        return np.arange(len(arc)), arc
    return unrolled(arc, float(arc[-1] - arc[0]) + step, pressure)


def refuse_unknown(name: str, names: Collection[str], what: str) -> None:
    """Raises RunError for a name that is not one of the ``names`` of this kind of items of a run."""
    if name not in names:
        known = f"there are: {', '.join(names)}" if names else "there is none"
        raise RunError(f'the run has no {what} "{name}"', known)


def contact_force(run: RunData, name: str, level: Level | None = None) -> FloatArray:
    """The force (S+1, 2) of a contact on its slave, as in path.csv, or that (2,) at a level."""
    values, contact = level or run, run.contacts[name]
    if run.is_finite:
        # Normals turn and lengths change: the forces are stored as such.
        return np.asarray(values[f"path/resultants/contact {name}"])
    pressure, traction = (values[f"contacts/{name}/{key}"] for key in ("pressure", "traction"))
    return force_on_slave(contact.weight, contact.normal, pressure, traction)


def tangential_force(run: RunData, name: str) -> FloatArray:
    """The force (S+1,) of a contact on its master along the mean tangent; zero where it is round-off."""
    contact, force = run.contacts[name], contact_force(run, name)
    largest = float(np.hypot(*force.T).max(initial=0.0))
    if not run.is_finite:
        # Without the pressures, whose resultant is normal only to the accuracy of the mean tangent.
        force = force - force_on_slave(contact.weight, contact.normal, contact.pressure)
    along = -force @ mean_tangent(run, name)
    return np.asarray(np.where(np.abs(along) > COARSE_ROUND_OFF * largest, along, 0.0))


def mean_tangent(run: RunData, name: str) -> FloatArray:
    """The mean (2,) of a contact's tangents before loading, weighted with its largest pressures."""
    contact = run.contacts[name]
    weight = contact.weight * contact.pressure.max(axis=0, initial=0.0)
    x, y = (weight if weight.any() else contact.weight) @ contact.normal
    return np.asarray(np.array([y, -x]) / np.hypot(x, y))
