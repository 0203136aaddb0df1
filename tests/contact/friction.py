"""Frictional contact of half-planes: condensed problems with known answers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as linalg

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.coulomb import event_driven_path, start
from mlsanm_cli.contact.response.compressed import LinearMap
from mlsanm_cli.contact.response.condensed import Condensed
from tests.contact.scenes import synthetic


@dataclass(frozen=True)
class HalfPlanes:
    """A cylinder of radius 1 on a half-plane, E* = 1; at load factors (1, 1) it carries ``force`` P and a
    shear force mu P. ``x`` (m,) are the nodes; the state's exact half-width is ``half``."""

    condensed: Condensed
    x: FloatArray
    half: float
    force: float
    friction: float

    @property
    def peak(self) -> float:
        """Largest pressure of Hertz' formula."""
        return 2.0 * self.force / (np.pi * self.half)

    def event_driven_path(self, *targets: tuple[float, float]) -> list[ContactState]:
        """The states at the ends of stages to these load factors."""
        state = start(self.condensed, np.zeros(2))
        found = []
        for target in targets:
            *_, state = event_driven_path(self.condensed, state, np.array(target), [1.0])
            found.append(state)
        return found

    def cattaneo(self, part: float) -> FloatArray:
        """Traction (m,) on the cylinder when a first shear force of ``part`` of mu P acts on it."""
        stick = self.half * np.sqrt(1.0 - part)
        arc = [np.sqrt(np.maximum(0.0, 1.0 - (self.x / r) ** 2)) for r in (self.half, stick)]
        return np.asarray(-self.friction * self.peak * (arc[0] - stick / self.half * arc[1]))


def strip_compliance(x: FloatArray, width: FloatArray | float) -> FloatArray:
    """Surface displacement of half-planes (E* = 1) along a force on strips (Flamant), up to a constant."""
    apart = x[:, None] - x[None, :]

    def primitive(s: FloatArray) -> FloatArray:
        return s * np.log(np.abs(s) / 2.0) - s

    return np.asarray(-2.0 / np.pi * (primitive(apart + 0.5 * width) - primitive(apart - 0.5 * width)))


def strip_coupling(x: FloatArray, width: FloatArray | float) -> FloatArray:
    """What pressure strips do across their direction for Dundurs' beta = 1: sums of sign functions."""
    apart = x[:, None] - x[None, :]
    return np.asarray(np.abs(apart + 0.5 * width) - np.abs(apart - 0.5 * width))


def half_planes(
    m: int = 80, friction: float = 0.3, beta: float = 0.0, shift: float = 0.0, finest: float | None = None
) -> HalfPlanes:
    """Two platen motions, down and along; ``shift`` moves the nodes off the symmetric places; the ``finest``
    strip, about the middle, is so much finer than those at the ends."""
    half, span = 0.05, 1.5
    width: FloatArray = np.full(m, 2.0 * span * half / m)
    x: FloatArray = (np.arange(m, dtype=np.float64) + 0.5) * width - span * half + shift
    if finest is not None:
        edges = span * half * finest * np.sinh(np.arcsinh(1.0 / finest) * np.linspace(-1.0, 1.0, m + 1))
        width, x = np.diff(edges), 0.5 * (edges[1:] + edges[:-1]) + shift
    force = 0.25 * np.pi * half**2
    normal, coupling = strip_compliance(x, width), beta * strip_coupling(x, width)
    counts = 2, 2, m, m
    moves, slides = np.zeros((m, 2)), np.zeros((m, 2))
    moves[:, 0], slides[:, 1] = 1.0, 1.0
    gap = 0.5 * x**2
    balance = LinearMap.of_loads(np.array([[force, 0.0], [0.0, -friction * force]]), counts)
    balance.pressure[0], balance.traction[1] = -width, -width
    base = synthetic(normal, gap)
    condensed = replace(
        base,
        weight=width,
        tangential={"contact": slice(0, m)},
        friction_nodes=np.arange(m),
        friction=np.full(m, friction),
        gap=LinearMap(gap, np.zeros((m, 2)), moves, normal, coupling),
        slip=LinearMap(np.zeros(m), np.zeros((m, 2)), slides, -coupling, normal),
        watched=LinearMap.zeros(0, counts),
        balance=balance,
    )
    return HalfPlanes(condensed, x, half, force, friction)


def side_by_side(one: Condensed, other: Condensed) -> Condensed:
    """Two problems of one contact each, "one" and "other", that know nothing of each other."""
    m, n = len(one.weight), len(one.friction_nodes)
    both = {"one": slice(0, m), "other": slice(m, m + len(other.weight))}
    rough = {"one": slice(0, n), "other": slice(n, n + len(other.friction_nodes))}

    def joined(a: LinearMap, b: LinearMap) -> LinearMap:
        parts = ("load", "motion", "pressure", "traction")
        blocks = [linalg.block_diag(getattr(a, part), getattr(b, part)) for part in parts]
        return LinearMap(np.concatenate([a.constant, b.constant]), *blocks)

    return replace(
        one,
        spans=both,
        tangential=rough,
        weight=np.concatenate([one.weight, other.weight]),
        friction_nodes=np.concatenate([one.friction_nodes, m + other.friction_nodes]),
        friction=np.concatenate([one.friction, other.friction]),
        gap=joined(one.gap, other.gap),
        slip=joined(one.slip, other.slip),
        balance=joined(one.balance, other.balance),
    )
