"""The state of a stored run at any position of its path, the origin of its values, and the estimated error of
interpolated ones."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Branch
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import RunData, read_series
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

NOTHING = partial(np.zeros, 0)
STORED, SERIES, LINEAR, INTERPOLATED = "stored", "series", "linear", "interpolated"


@dataclass(frozen=True)
class Level:
    """A position of a path.

    ``how`` its state is known: stored in ``row``, from the series of the step that ends there, or as a mean
    of that row, with the weight ``share``, and the one before: exact without unilateral contact or if the
    load factors are constant ("linear"), else "interpolated".

    Series give ``pressure`` and ``gap`` (m,), ``motion`` (k,) and ``traction`` (n,), over all contacts.
    """

    position: float
    how: str
    row: int
    share: float
    factors: FloatArray
    pressure: FloatArray = field(default_factory=NOTHING)
    gap: FloatArray = field(default_factory=NOTHING)
    motion: FloatArray = field(default_factory=NOTHING)
    traction: FloatArray = field(default_factory=NOTHING)

    @property
    def unknowns(self) -> FloatArray:
        """The argument (1 + u,) of the stored maps."""
        return np.concatenate([[1.0], self.factors, self.motion, self.pressure, self.traction])

    def between(self, history: FloatArray) -> FloatArray:
        """A history (S+1, ...) at this level, if it is not known by series."""
        row = np.asarray(history[self.row], dtype=np.float64)
        if self.how == STORED:
            return row
        result: FloatArray = self.share * row + (1.0 - self.share) * history[self.row - 1]
        return result


def level_at(run: RunData, position: float) -> Level:
    """The level of a path position. Raises RunError if the path does not reach it, and between stored states
    at finite strain."""
    rows = np.asarray(run.path.position)
    if not len(rows):
        raise RunError(f"{run.directory} holds no finished step yet")
    # Not relative to the requested position, which may be infinite.
    slack = FINE_ROUND_OFF * max(float(rows[-1]), 1.0)
    last = float(rows.max())
    if not rows[0] - slack <= position <= last + slack:
        raise RunError(
            f"the path does not reach position {position:g}: it goes from {rows[0]:g} to {last:g}",
            "a position is the number of completed stages plus the fraction of the current one",
        )
    same = np.flatnonzero(np.abs(rows - position) <= slack)
    if len(same):
        row = int(same[0])
        return Level(float(rows[row]), STORED, row, 1.0, _factors(run, row, 1.0))
    row = int(np.flatnonzero(rows > position)[0])
    if run.is_finite:
        raise RunError(
            f"nothing is stored between positions {rows[row - 1]:.6g} and {rows[row]:.6g}, "
            "and results at finite strain are not interpolated",
            f"run again with {position:g} in output.at",
        )
    share = float((position - rows[row - 1]) / (rows[row] - rows[row - 1]))
    factors = _factors(run, row, share)
    arrays, attributes = read_series(run.directory, row)
    if arrays:
        names = [name for name in ("pressure", "gap", "motion", "traction") if name in arrays]
        parts = [arrays[name] for name in names]
        length = float(attributes["length"])
        branch = Branch(np.hstack(parts), arrays["position"], length, arrays.get("denominator"))
        x, _ = branch.evaluate(branch.parameter_at(position))
        ends = np.cumsum([part.shape[1] for part in parts])[:-1]
        values = dict(zip(names, np.split(x, ends), strict=True))
        return Level(position, SERIES, row, share, factors, **values)
    linear = not run.unilateral_contacts or np.array_equal(factors, _factors(run, row - 1, 1.0))
    return Level(position, LINEAR if linear else INTERPOLATED, row, share, factors)


def _factors(run: RunData, row: int, share: float) -> FloatArray:
    """Load factors (L,), which are linear within a stage."""
    history = np.array(list(run.path.factors.values()))
    return np.asarray(share * history[:, row] + (1.0 - share) * history[:, row - 1], dtype=np.float64)


def displacement_at(run: RunData, level: Level, body: str) -> tuple[FloatArray, str]:
    """Nodal displacements (n, 2) of a body at a level, and their origin. Without unilateral contact states
    can be superposed: saved ones give any level whose load factors are a linear combination of theirs. Raises
    RunError if the displacements are neither saved nor given by that."""
    saved = [state for state in run.states if "displacement" in state.bodies[body]]
    if not saved:
        raise RunError(
            f"{run.directory} holds no displacement fields",
            'add "displacement" to output.fields, or a [[probe]] at the point',
        )
    for state in saved:
        if abs(state.position - level.position) <= FINE_ROUND_OFF * max(abs(level.position), 1.0):
            return state.bodies[body]["displacement"], STORED
    if not run.unilateral_contacts and not run.is_finite:
        known = np.array([level_at(run, state.position).factors for state in saved])
        shares = np.linalg.lstsq(known.T, level.factors, rcond=None)[0]
        missed = np.abs(shares @ known - level.factors).max(initial=0.0)
        if missed <= ROUND_OFF * max(np.abs(level.factors).max(initial=0.0), 1.0):
            fields = np.array([state.bodies[body]["displacement"] for state in saved])
            return np.asarray(np.einsum("s,snd->nd", shares, fields), dtype=np.float64), LINEAR
    places = ", ".join(f"{state.position:g}" for state in saved)
    raise RunError(
        f"fields are saved at position {places} only, not at {level.position:g}",
        f"run again with {level.position:g} in output.at, or with a [[probe]] at the point",
    )


MAX_ERROR = 0.25
"""Largest estimated error of interpolated values, relative to the largest of the two states."""

EDGE = 0.5
"""Errors shrink like this power of the distance of the states: pressures grow like the root of the distance
from an edge of contact, which moves with the load (Hertz: 0.120 of the peak there, 0.117 estimated)."""


def interpolation_error(position: FloatArray, history: FloatArray, row: int, share: float) -> float:
    """The estimated largest absolute error of the interpolation between two rows of a ``history`` (S+1, ...).

    ``share`` is the weight of ``row``, the rest that of the row before; ``position`` is (S+1,). The estimate
    is the error of adjacent stored rows, interpolated from their neighbours in the same stage, times a power
    of the ratio of distances. Infinite if a stage has fewer than three rows.
    """
    gap = position[row] - position[row - 1]
    found = []
    for middle in (row - 1, row):
        if not 1 <= middle < len(position) - 1:
            continue
        before, after = np.diff(position[middle - 1 : middle + 2])
        of_stage = np.ceil(position[middle : middle + 2] - FINE_ROUND_OFF)
        if of_stage[0] == of_stage[1] and before > 0.0 and after > 0.0:
            first, own, last = np.asarray(history[middle - 1 : middle + 2], dtype=np.float64)
            part = before / (before + after)
            missed = np.abs((1.0 - part) * first + part * last - own).max(initial=0.0)
            finer = share * (1.0 - share) * gap**2 / (before * after)
            found.append(float(finer ** (0.5 * EDGE) * missed))
    return max(found, default=np.inf)


def checked_error(run: RunData, level: Level, name: str, *histories: FloatArray) -> float | None:
    """The estimated error of interpolated ``histories`` (S+1, ...), called ``name``, relative to the largest
    value of the first in the adjacent rows; None if the level is not interpolated. Raises RunError if the
    error is too large or unknown."""
    if level.how != INTERPOLATED:
        return None
    position = np.asarray(run.path.position)
    before, after = position[level.row - 1 : level.row + 1]
    largest = float(np.abs(np.asarray(histories[0])[level.row - 1 : level.row + 1]).max(initial=0.0))
    missed = max(interpolation_error(position, one, level.row, level.share) for one in histories)
    error = missed / largest if missed else 0.0
    if error > MAX_ERROR:
        raise RunError(
            f"nothing is stored between positions {before:.6g} and {after:.6g}, "
            f"which are too far apart to interpolate {name}",
            f"run again with {level.position:g} in output.at, or with power series (law hyperbolic, method "
            f"anm), which give results everywhere",
        )
    return error


def pressures_at(run: RunData, position: float) -> dict[str, FloatArray]:
    """Pressure (m,) of every contact at a path position. Raises RunError where the path does not reach the
    position, or where too little is stored about it."""
    level = level_at(run, position)
    for contact in run.contacts.values():
        checked_error(run, level, "pressures", contact.pressure)
    if level.how != SERIES:
        return {name: level.between(contact.pressure) for name, contact in run.contacts.items()}
    ends = np.cumsum([len(run.contacts[name].arc_length) for name in run.unilateral_contacts])
    found = dict(zip(run.unilateral_contacts, np.split(level.pressure, ends[:-1]), strict=True))
    for name, rows in run.maps["bonds"].items():
        found[name] = np.split(rows @ level.unknowns, 2)[0]
    return {name: found[name] for name in run.contacts}


def refuse_unknown(name: str, names: Collection[str], what: str) -> None:
    """Raises RunError for a name that is not one of the ``names`` of this kind of items of a run."""
    if name not in names:
        there = f"there are: {', '.join(names)}" if names else "there is none"
        raise RunError(f'the run has no {what} "{name}"', there)


def pressing_force(run: RunData, name: str) -> FloatArray:
    """The force (S+1, 2) of a contact's pressures on its slave; at finite strain of its tractions too."""
    contact = run.contacts[name]
    if run.is_finite:
        # Normals turn and lengths change: the forces are stored as such.
        return np.asarray(run.path.resultants[f"contact {name}"])
    return np.asarray(contact.pressure @ (contact.weight[:, None] * contact.normal))


def tangential_force(run: RunData, name: str) -> FloatArray:
    """The force (S+1,) of a contact on its master along the mean tangent."""
    contact = run.contacts[name]
    if run.is_finite:
        n_x, n_y = mean_normal(run, name)
        return np.asarray(-pressing_force(run, name) @ np.array([n_y, -n_x]))
    return np.asarray(-(contact.traction @ contact.weight))


def mean_normal(run: RunData, name: str) -> FloatArray:
    """The mean (2,) of a contact's normals before loading, where it is pressed at some time, as a unit
    vector."""
    contact = run.contacts[name]
    weight = np.where((contact.pressure > 0.0).any(axis=0), contact.weight, 0.0)
    mean = (weight if weight.any() else contact.weight) @ contact.normal
    return np.asarray(mean / np.hypot(*mean))
