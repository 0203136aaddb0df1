"""The state of a stored run at any position of its path, and the origin of its values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import Branch
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.run_reader import RunData, read_series

STORED, SERIES, LINEAR, INTERPOLATED = "stored", "series", "linear", "interpolated"
POSITION_TOLERANCE = 1e-12
"""Difference per stage below which positions are equal."""
SUPERPOSITION_TOLERANCE = 1e-9
"""Relative error below which the load factors of a level are a linear combination of saved ones."""


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
    pressure: FloatArray
    gap: FloatArray
    motion: FloatArray
    traction: FloatArray

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
    """The level of a path position.

    Raises RunError if the path does not reach it, and between stored states at finite strain.
    """
    rows = np.asarray(run.path.position)
    finite = run.is_finite
    if not len(rows):
        raise RunError(f"{run.directory} holds no finished step yet")
    # Not relative to the requested position, which may be infinite.
    slack = POSITION_TOLERANCE * max(float(rows[-1]), 1.0)
    last = float(rows.max())
    if not rows[0] - slack <= position <= last + slack:
        raise RunError(
            f"the path does not reach position {position:g}: it goes from {rows[0]:g} to {last:g}",
            "a position is the number of completed stages plus the fraction of the current one",
        )
    nothing = np.zeros(0)
    same = np.flatnonzero(np.abs(rows - position) <= slack)
    if len(same):
        row = int(same[0])
        factors = _factors(run, row, 1.0)
        return Level(float(rows[row]), STORED, row, 1.0, factors, nothing, nothing, nothing, nothing)
    row = int(np.flatnonzero(rows > position)[0])
    if finite:
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
        values = {"traction": nothing, **dict(zip(names, np.split(x, ends), strict=True))}
        return Level(position, SERIES, row, share, factors, **values)
    linear = not run.unilateral_contacts or np.array_equal(factors, _factors(run, row - 1, 1.0))
    how = LINEAR if linear else INTERPOLATED
    return Level(position, how, row, share, factors, nothing, nothing, nothing, nothing)


def _factors(run: RunData, row: int, share: float) -> FloatArray:
    """Load factors (L,), which are linear within a stage."""
    history = np.array([np.asarray(values) for values in run.path.factors.values()])
    if share == 1.0:
        return np.asarray(history[:, row], dtype=np.float64)
    return np.asarray(share * history[:, row] + (1.0 - share) * history[:, row - 1], dtype=np.float64)


def displacement_at(run: RunData, level: Level, body: str) -> tuple[FloatArray, str]:
    """Nodal displacements (n, 2) of a body at a level, and their origin.

    Without unilateral contact states can be superposed: saved ones give any level whose load factors are a
    linear combination of theirs. Raises RunError if the displacements are neither saved nor given by that.
    """
    saved = [state for state in run.states if "displacement" in state.bodies[body]]
    if not saved:
        raise RunError(
            f"{run.directory} holds no displacement fields",
            'add "displacement" to output.fields, or a [[probe]] at the point',
        )
    for state in saved:
        if abs(state.position - level.position) <= POSITION_TOLERANCE * max(abs(level.position), 1.0):
            return state.bodies[body]["displacement"], STORED
    if not run.unilateral_contacts and not run.is_finite:
        known = np.array([level_at(run, state.position).factors for state in saved])
        shares = np.linalg.lstsq(known.T, level.factors, rcond=None)[0]
        missed = np.abs(shares @ known - level.factors).max(initial=0.0)
        if missed <= SUPERPOSITION_TOLERANCE * max(np.abs(level.factors).max(initial=0.0), 1.0):
            fields = np.array([state.bodies[body]["displacement"] for state in saved])
            return np.asarray(np.einsum("s,snd->nd", shares, fields), dtype=np.float64), LINEAR
    places = ", ".join(f"{state.position:g}" for state in saved)
    raise RunError(
        f"fields are saved at position {places} only, not at {level.position:g}",
        f"run again with {level.position:g} in output.at, or with a [[probe]] at the point",
    )
