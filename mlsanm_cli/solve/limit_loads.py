"""Error messages of paths that end at a limit load: what slides, tips or separates, and at which part of the
loads."""

from __future__ import annotations

import itertools

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.complementarity.equilibrium import BALANCED, equilibrium
from mlsanm_cli.contact.laws.failures import NoStateError, SlidingError, UnbalancedError, UnresistedError
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

MIN_REACHED = 0.85
"""Part of a limit load at which a path that ends is reported as having reached it."""
LAST_LEVEL = 0.9
"""Part of a limit load of the last state that scales and refines the path."""
MIN_MOTION = 1e-3
"""Least motion of a body, relative to the largest, in a mechanism."""
SLIDES = "slide"
"""What messages call it."""
MIN_FRICTION_WORK = 0.5
"""Part of the work of the loads dissipated by friction above which the mechanism is sliding."""


@dataclass(frozen=True, eq=False)
class LimitLoad:
    """``part`` of a stage's load change that can be carried, collapse ``motion`` (k,) up to a factor,
    ``friction_share`` of the loads' work in it that friction dissipates, whether any contact is ``pressed``,
    and whether the loads themselves drive it, not their round-off."""

    part: float
    motion: FloatArray
    friction_share: float
    pressed: bool
    driven: bool

    @property
    def whole(self) -> bool:
        """Whether the whole stage can be carried, by contacts closed or still open."""
        return self.part > 1.0 - BALANCED

    @classmethod
    def of(cls, condensed: Condensed, begin: FloatArray, change: FloatArray) -> LimitLoad | None:
        """Largest part <= 1 for load factors ``begin`` (L,) + part ``change`` (L,); None if nothing can be
        carried, or if no motion is unknown."""
        balance, nodes, m = condensed.balance, condensed.friction_nodes, len(condensed.weight)
        start, more = balance.constant + balance.load @ begin, balance.load @ change
        if not len(start) or not m or not (start.any() or more.any()):
            return None
        rows = np.hstack([balance.pressure, balance.traction, balance.motion])
        largest = np.abs(rows[:, : m + len(nodes)]).max(axis=1)
        scale = np.where(largest > 0.0, largest, np.abs(rows).max(axis=1))
        scale = np.where(scale > 0.0, scale, 1.0)
        found = equilibrium(rows / scale[:, None], nodes, condensed.friction, start / scale, more / scale)
        if found is None:
            return None
        pressure, traction = np.split(found.forces, [m])
        motion = found.mechanism / scale
        work = abs(float(more @ motion)) * found.part
        across, along = np.abs(condensed.gap.motion @ motion), np.abs(condensed.slip.motion @ motion)
        if work:
            share = float(np.abs(traction * (balance.traction.T @ motion)).sum()) / work
        else:
            # Nothing is carried: the direction of motion decides.
            share = float(along.max(initial=0.0) > across.max(initial=0.0))
        moved = pressure[np.abs(balance.pressure.T @ motion) + across > 0.0]
        pressed = moved.max(initial=0.0) > ROUND_OFF * pressure.max(initial=0.0)
        most = float(np.abs(more / scale).max() * np.abs(motion * scale).max())
        driven = abs(float(more @ motion)) > COARSE_ROUND_OFF * most
        return cls(found.part, motion, min(share, 1.0), bool(pressed), driven)


def at_limit(
    scene: Scene, condensed: Condensed, stages: FloatArray, last: float, error: NumericalError
) -> NumericalError:
    """The error that ended a path along ``stages`` (T + 1, L) at position ``last``, or the limit load that it
    came close to."""
    stage = min(int(last), len(stages) - 2)
    named = _limit(scene, condensed, stages, stage, last - stage)
    if named is None:
        return error
    text, hint = named
    if isinstance(error, SlidingError) and f" {SLIDES}" in text:
        return error
    return NumericalError(f"{text} (the path ended at {last:.6g}: {error.message})", hint)


def beyond_limit(
    scene: Scene, condensed: Condensed, stages: FloatArray, error: UnbalancedError | NoStateError
) -> UnbalancedError | NoStateError:
    """The error that no state balances the loads at the end of a stage, or the limit load."""
    for stage in range(len(stages) - 1):
        named = _limit(scene, condensed, stages, stage, None)
        if named is not None:
            return UnbalancedError(*named)
    return error


def check_resisted(scene: Scene, condensed: Condensed, stages: FloatArray) -> None:
    """Raise UnresistedError if the first loads drive bodies that no pressures and tractions hold."""
    limit = LimitLoad.of(condensed, stages[0], stages[1] - stages[0])
    if limit is not None and limit.driven and limit.part <= COARSE_ROUND_OFF:
        raise UnresistedError(*_named(scene, condensed, stages, 0, limit))


def near_limit(condensed: Condensed, stages: FloatArray) -> tuple[FloatArray, float] | None:
    """Load factors (L,) just below the first limit load of ``stages`` (T + 1, L), and their position; None
    without a limit load, or if loads cannot be carried at all."""
    for stage, (begin, end) in enumerate(itertools.pairwise(stages)):
        limit = LimitLoad.of(condensed, begin, end - begin)
        if limit is None or limit.part <= COARSE_ROUND_OFF:
            return None
        if not limit.whole:
            return begin + LAST_LEVEL * limit.part * (end - begin), stage + limit.part
    return None


def _limit(
    scene: Scene, condensed: Condensed, stages: FloatArray, stage: int, came: float | None
) -> tuple[str, str] | None:
    """Message and hint of a limit load within a stage; None if there is none, or if a path ``came`` to
    another part of the stage."""
    limit = LimitLoad.of(condensed, stages[stage], stages[stage + 1] - stages[stage])
    if limit is None or limit.whole or (came is not None and not MIN_REACHED * limit.part <= came):
        return None
    return _named(scene, condensed, stages, stage, limit)


def _named(
    scene: Scene, condensed: Condensed, stages: FloatArray, stage: int, limit: LimitLoad
) -> tuple[str, str]:
    """Message and hint of the limit load of a stage."""
    names, how = _mechanism(scene, condensed, limit)
    if limit.part <= COARSE_ROUND_OFF:
        hint = f"fix {names} with a [[support]]"
        if limit.friction_share > MIN_FRICTION_WORK:
            hint += ", or raise friction"
        return f"{names} {how}: the contacts cannot carry any load added in stage {stage + 1}", hint
    changes = zip(scene.loads, stages[stage], stages[stage + 1], strict=True)
    moved = [name for name, a, b in changes if a != b]
    return (
        f"{names} {how} at position {stage + limit.part:.6g}: beyond this limit load no pressures and "
        f"tractions balance the loads",
        f"apply at most {100.0 * limit.part:.3g} % of the change of {', '.join(moved)} in stage {stage + 1}, "
        f"or fix {names} with a [[support]]",
    )


def _mechanism(scene: Scene, condensed: Condensed, limit: LimitLoad) -> tuple[str, str]:
    """Names of the moving bodies, and the kind of their motion."""
    names, turns = moving_bodies(scene, limit.motion)
    text = ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
    several = len(names) > 1
    if limit.friction_share > MIN_FRICTION_WORK:
        how = SLIDES if several else f"{SLIDES}s"
    elif turns.any() and (limit.pressed or _pushed(condensed, limit.motion, turns)):
        how = "tip over" if several else "tips over"
    else:
        how = "lose contact" if several else "loses contact"
    return text, how


def moving_bodies(scene: Scene, motions: FloatArray) -> tuple[list[str], BoolArray]:
    """Bodies and obstacles that ``motions`` (k,) move, and which motions (k,) are rotations."""
    sizes: dict[str, float] = {}
    turns = np.zeros(len(motions), dtype=bool)
    for number, (constraint, motion) in enumerate(scene.unknown_motions):
        part, points = abs(float(motions[number])), {}
        if not constraint.bodies:
            points[f"the obstacle of contact {constraint.name}"] = np.zeros((1, 2))
        else:
            points |= {f"body {n}": scene.bodies[n].model.cloud.points for n in constraint.bodies}
        for name, places in points.items():
            pattern = motion.pattern(places, constraint.center)
            moved = part * float(np.hypot(*pattern.T).max())
            sizes[name] = max(sizes.get(name, 0.0), moved)
            turns[number] |= motion.component == ROTATION and moved > 0.0
    largest = max(sizes.values())
    return [name for name, size in sizes.items() if size > MIN_MOTION * largest], turns


def _pushed(condensed: Condensed, motion: FloatArray, turns: BoolArray) -> bool:
    """Whether a motion (k,) that opens contacts would close others without its part ``turns`` (k,)."""
    opening = condensed.gap.motion @ motion
    moved = condensed.gap.motion @ np.where(turns, 0.0, motion) * np.sign(opening.sum())
    return bool(moved.min(initial=0.0) < -COARSE_ROUND_OFF * np.abs(opening).max(initial=0.0))
