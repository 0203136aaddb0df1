"""Errors of published cases against their closed formulas, for gallery.py: the functions of gallery.toml."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.formulas import FlatPunch, KirschHole, LameRing, PinInHole, plates_approach, press_fit
from mlsanm_cli.app.checks.references import HertzLine
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.geometry.profile import half_width
from mlsanm_cli.io.run_reader import Dataset, RunData

Judge = Callable[[RunData], dict[str, float]]


@dataclass(frozen=True)
class Entry:
    """Which picture of `mlsanm plot` shows the case, what it is checked against, and its relative errors (by
    its summary if None)."""

    picture: str
    formula: str
    judge: Judge | None = None


REFERENCES = {
    "hertz-line": Entry(
        "pressure", "Hertz' line contact: p = p0 sqrt(1 - x²/a²), a² = 4 F R/(pi E*), p0 = 2 F/(pi a)"
    ),
    "uniform-pressure": Entry("bodies", "the same pressure everywhere"),
}
"""Of cases with a [reference] that gallery.toml does not name."""


def entries() -> dict[str, Entry]:
    """The cases of gallery.toml."""
    table = tomllib.loads(Path(__file__).with_name("gallery.toml").read_text())
    return {
        name: Entry(row["picture"], row["formula"], partial(globals()[row["judge"]], *row.get("given", ())))
        for name, row in table.items()
    }


def _only(run: RunData) -> Dataset:
    contact: Dataset
    (contact,) = run.contacts.values()
    return contact


def _at(run: RunData, position: float) -> int:
    return int(np.flatnonzero(run.path.position == position)[0])


def kirsch(run: RunData) -> dict[str, float]:
    points, stress = run.bodies["plate"].points, run.states[-1].bodies["plate"]["stress"]
    rim = np.hypot(points[:, 0], points[:, 1]) <= 1.0 + 1e-9
    exact = KirschHole(1.0, 100.0).stress(points)
    return {
        "largest stress": abs(stress[rim, 0].max() / exact[rim, 0].max() - 1.0),
        "stress anywhere, over the largest": np.abs(stress - exact).max() / exact.max(),
    }


def lame(run: RunData) -> dict[str, float]:
    ring = LameRing(1.0, 2.0, 100.0, 210e3 / (1.0 - 0.3**2), 0.3 / 0.7)
    points, fields = run.bodies["ring"].points, run.states[-1].bodies["ring"]
    r = np.hypot(points[:, 0], points[:, 1])
    c, s = (points / r[:, None]).T
    moved, expected = fields["displacement"] @ np.eye(2), ring.displacement(r)
    xx, yy, xy = fields["stress"].T
    radial, hoop = ring.stress(r)
    off = np.maximum(
        np.abs(xx * c**2 + yy * s**2 + 2.0 * xy * c * s - radial),
        np.abs(xx * s**2 + yy * c**2 - 2.0 * xy * c * s - hoop),
    )
    return {
        "displacement": np.abs(moved[:, 0] * c + moved[:, 1] * s - expected).max() / expected.max(),
        "stress": off.max() / np.abs(hoop).max(),
    }


def cattaneo(half: float, peak: float, end: float, run: RunData) -> dict[str, float]:
    """The part of the tractions even about the middle, for the pressing of finite bodies shears a little: at
    position 2, and at the ``end`` of the shear back."""
    contact, friction = _only(run), 0.3
    x = np.linspace(-1.3 * half, 1.3 * half, 2001)
    order = np.argsort(contact.points[:, 0])
    inner = half * np.sqrt(0.5)
    arcs = [np.sqrt(np.maximum(0.0, 1.0 - (x / r) ** 2)) for r in (half, inner)]
    expected = friction * peak * (arcs[0] - inner / half * arcs[1])

    def even(values: FloatArray) -> FloatArray:
        nodes, values = contact.points[order, 0], values[order]
        return 0.5 * (np.interp(x, nodes, values) + np.interp(-x, nodes, values))

    found = {name: even(contact.traction[_at(run, at)]) for name, at in (("sheared", 2.0), ("reversed", end))}
    signs = {"sheared": -1.0, "reversed": 1.0}
    return {
        f"traction, {name}, L2": float(
            np.linalg.norm(values - signs[name] * expected) / np.linalg.norm(expected)
        )
        for name, values in found.items()
    }


def slide(run: RunData) -> dict[str, float]:
    contact = _only(run)
    force = contact.traction @ contact.weight / 200.0
    return {"friction force": max(abs(force[_at(run, 2.0)] + 0.3), abs(force[_at(run, 3.0)] - 0.3)) / 0.3}


def sliding_patch(run: RunData) -> dict[str, float]:
    contact, friction, shear = _only(run), 0.3, 210e3 / 2.6
    rows = _at(run, 2.0), _at(run, 3.0)
    way = 0.002 - friction * 100.0 * 2.0 / shear
    work = friction * 200.0 * way * np.array([1.0, 3.0])
    traction = [
        np.abs(contact.traction[row] / (sign * 30.0) - 1.0).max()
        for row, sign in zip(rows, (-1.0, 1.0), strict=True)
    ]
    return {
        "pressure": max(np.abs(contact.pressure[row] / 100.0 - 1.0).max() for row in rows),
        "traction": max(traction),
        "dissipated work": float(np.abs(contact.dissipated_work[list(rows)] / work - 1.0).max()),
    }


def wedge(run: RunData) -> dict[str, float]:
    friction = tomllib.loads(run.case_resolved)["contact"][0]["friction"]
    expected = (0.1 + friction) / (1.0 - 0.1 * friction)
    return {"pushing force": abs(run.path.resultants["push"][-1, 0] / 100.0 / expected - 1.0)}


def shear_patch(run: RunData) -> dict[str, float]:
    contact = _only(run)
    return {
        "pressure": np.abs(contact.pressure[-1] / 100.0 - 1.0).max(),
        "traction": np.abs(contact.traction[-1] / -20.0 - 1.0).max(),
    }


def pin(run: RunData) -> dict[str, float]:
    contact = _only(run)
    pin = PinInHole(10.0, 0.03, 5000.0, 210e3)
    width = half_width(contact.arc_length, contact.pressure[-1])
    return {
        "peak": abs(contact.pressure[-1].max() / pin.peak_pressure - 1.0),
        "angle of contact": abs(width / (10.0 * pin.half_angle) - 1.0),
    }


def cantilever(run: RunData) -> dict[str, float]:
    tips = {0.1: (0.0572, 0.3039), 0.2: (0.1634, 0.4979), 0.4: (0.3354, 0.6775), 1.0: (0.5674, 0.8253)}
    moved = run.probes["end"].displacement / 10.0
    off = [
        np.abs(moved[_at(run, position)] - [-short, deep]).max() for position, (short, deep) in tips.items()
    ]
    return {"displacement of the end, over the length": float(max(off))}


def deep(run: RunData) -> dict[str, float]:
    found = -2.0 * run.path.resultants["press"][:, 1]
    forces = {1.0 / 3.0: 0.1691, 2.0 / 3.0: 0.4097, 1.0: 0.701}
    return {"force": max(abs(found[_at(run, position)] / exact - 1.0) for position, exact in forces.items())}


def snapped(run: RunData) -> dict[str, float]:
    summary = json.loads((run.directory / "summary.json").read_text())
    limit, lower = (0.2 * point["position"] for point in summary["finite_strain"]["limit_points"])
    return {"limit load": abs(limit / 0.14431 - 1.0), "lower limit load": abs(lower / 0.07607 - 1.0)}


def inflated(run: RunData) -> dict[str, float]:
    """Rivlin's tube: r^2 = R^2 + 1.25, stresses differ by s - 1/s with s = r^2/R^2."""
    tube, fields = run.bodies["tube"].points, run.states[-1].bodies["tube"]
    radius = np.hypot(*tube.T)
    grown = np.sqrt(radius**2 + 1.25)
    points, weights = np.polynomial.legendre.leggauss(40)
    outer = np.sqrt(5.25)
    half = 0.5 * (outer - grown)
    r = grown[:, None] + half[:, None] * (1.0 + points)
    s = r**2 / (r**2 - 1.25)
    radial = -half * ((s - 1.0 / s) / r @ weights)
    hoop = radial + (grown / radius) ** 2 - (radius / grown) ** 2
    moved = (tube * fields["displacement"]).sum(axis=1) / radius
    return {
        "displacement": np.abs(moved - (grown - radius)).max() / 0.5,
        "stress": np.abs(fields["stress"].T[:2].sum(axis=0) - radial - hoop).max() / hoop.max(),
    }


def self_weight(run: RunData) -> dict[str, float]:
    y, fields = run.bodies["block"].points[:, 1], run.states[-1].bodies["block"]
    settled = -0.024 / (30e3 * 0.8 / (1.2 * 0.6)) * (3.0 * y - 0.5 * y**2)
    return {
        "displacement": np.abs(fields["displacement"][:, 1] - settled).max() / np.abs(settled).max(),
        "stress": np.abs(fields["stress"][:, 1] + 0.024 * (3.0 - y)).max() / 0.072,
    }


def orthotropic(run: RunData) -> dict[str, float]:
    c, s = np.sqrt(0.75), 0.5
    own = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s], [-c * s, c * s, c * c - s * s]])
    compliance = np.array(
        [[1 / 12e3, -0.4 / 12e3, 0.0], [-0.4 / 12e3, 1 / 0.9e3, 0.0], [0.0, 0.0, 1 / 0.7e3]]
    )
    stress = np.array([8.0, 0.0, 2.0])
    total = own.T @ (compliance @ own @ stress + 40.0 * np.array([4e-6, 35e-6, 0.0]))
    points, fields = run.bodies["board"].points, run.states[-1].bodies["board"]
    moved = np.stack([points @ [total[0], total[2]], total[1] * points[:, 1]], axis=1)
    return {
        "displacement": np.abs(fields["displacement"] - moved).max() / np.abs(moved).max(),
        "stress": np.abs(fields["stress"] - stress).max() / 8.0,
    }


def plates(run: RunData) -> dict[str, float]:
    modulus = 210e3 / (1.0 - 0.3**2)
    approach, hertz = plates_approach(500.0, 1.0, modulus), HertzLine(500.0, 1.0, modulus)
    peaks = [contact.pressure[-1].max() for contact in run.contacts.values()]
    return {
        "approach": abs(-run.path.displacements["press"][-1, 1] / approach - 1.0),
        "peak": max(abs(peak / hertz.peak_pressure - 1.0) for peak in peaks),
    }


def stack(run: RunData) -> dict[str, float]:
    return {"pressure": max(abs(c.pressure[-1] / 100.0 - 1.0).max() for c in run.contacts.values())}


def fit(run: RunData) -> dict[str, float]:
    hub, bush = LameRing(1.0, 1.6, 1.0, 210e3, 0.3), LameRing(0.6, 1.0, 1.0, 100e3, 0.34)
    return {"pressure": abs(_only(run).pressure[-1] / press_fit(bush, hub, 0.001) - 1.0).max()}


def forces(contact: str, axis: int, expected: list[float], run: RunData) -> dict[str, float]:
    rows = [_at(run, state.position) for state in run.states]
    found = run.path.resultants[f"contact {contact}"][rows, axis]
    return {"force": float(np.abs(found / np.array(expected) - 1.0).max())}


def ironed(run: RunData) -> dict[str, float]:
    across, up = run.path.resultants["contact iron"][[_at(run, state.position) for state in run.states]].T
    return {"horizontal force": float(np.abs(across / up).max()), "vertical force": float(np.ptp(up) / up[0])}


def punch(run: RunData) -> dict[str, float]:
    contact, punch = _only(run), FlatPunch(100.0, 0.2)
    inside = np.abs(contact.points[:, 0]) < 0.18
    weight, expected = contact.weight[inside], punch.pressure(contact.points[inside, 0])
    error = contact.pressure[-1][inside] - expected
    return {"pressure at |x| < 0.9 a, L2": float(np.sqrt(weight @ error**2 / (weight @ expected**2)))}


def springback(run: RunData) -> dict[str, float]:
    y, ratio = run.bodies["beam"].points[:, 1], 1.4
    core = 5.0 * np.sqrt(3.0 - 2.0 * ratio)
    bent = np.clip(y / core, -1.0, 1.0)
    stresses = [state.bodies["beam"]["stress"][:, 0] / 250.0 for state in run.states]
    errors = (stresses[0] - bent, stresses[1] - bent + ratio * y / 5.0)
    names = ("stress, bent", "residual stress")
    return {f"{name}, over the yield stress": rms(error) for name, error in zip(names, errors, strict=True)}


def rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))


def indentation(run: RunData) -> dict[str, float]:
    # Per unit of E and of the whole width; 3,816 nodes of quadratic elements.
    known = {0.5: 0.79054e-3, 1.0: 1.50860e-3, 2.0: 0.59241e-3}
    force = run.path.resultants["press"][:, 1] / 50.0
    return {
        name: abs(abs(force[_at(run, position)]) / known[position] - 1.0)
        for name, position in (("force, half way", 0.5), ("force, deepest", 1.0), ("force, withdrawn", 2.0))
    }
