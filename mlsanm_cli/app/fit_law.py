"""Constants of laws of rubber from tests: least squares of nominal stresses.

Rubber is incompressible in these tests to their accuracy, so that stresses follow from the stretch (Treloar
1944, doi:10.1039/TF9444000059)::

    uniaxial     l, l^-1/2, l^-1/2        equibiaxial     l, l, l^-2        planar     l, 1, 1/l

Differences are relative to the largest stress of their test, so that every test counts alike.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.curves import Curve, Panel, Picture, draw
from mlsanm_cli.mechanics.laws.hyperelastic import Hyperelastic
from mlsanm_cli.mechanics.laws.law import law_class
from mlsanm_cli.toml import toml_value

TESTS = ("uniaxial", "equibiaxial", "planar")
COLUMNS = ("test", "stretch", "stress")
DEFAULT_NU = 0.499
"""Poisson's ratio of rubber with a bulk modulus of 500 shear moduli."""
POINTS = 60
"""Points of the curves in the picture."""


class Constant(NamedTuple):
    """A constant of a law: its ``start``, times the shear modulus if it is a ``modulus``, and limits."""

    start: float
    modulus: bool
    least: float = 0.0
    most: float = np.inf


START: Mapping[str, Mapping[str, Sequence[Constant]]] = {
    "neo-hookean": {"E": [Constant(3.0, True)]},
    "mooney-rivlin": {"c10": [Constant(0.4, True)], "c01": [Constant(0.1, True)]},
    "yeoh": {
        "c10": [Constant(0.5, True)],
        "c20": [Constant(0.0, True, -np.inf)],
        "c30": [Constant(0.0, True, -np.inf)],
    },
    "arruda-boyce": {"mu": [Constant(1.0, True)], "locking_stretch": [Constant(4.0, False, 1.01, 100.0)]},
    "ogden": {
        "shear_moduli": [Constant(1.0, True), Constant(0.01, True), Constant(-0.1, True, -np.inf, 0.0)],
        "exponents": [
            Constant(1.5, False, 0.1, 20.0),
            Constant(5.0, False, 0.1, 20.0),
            Constant(-2.0, False, -20.0, -0.1),
        ],
    },
}
"""Constants of the laws, from which the search starts. Limits keep energies of stretches convex."""


class Fitted(NamedTuple):
    """A ``law`` with its ``constants``; ``errors`` are root mean squares by test, relative to the largest
    stress; ``falling`` names tests in which the stress falls with the stretch within the data."""

    law: str
    constants: Mapping[str, Any]
    errors: Mapping[str, float]
    falling: Sequence[str]

    @property
    def error(self) -> float:
        return float(np.sqrt(np.mean([error**2 for error in self.errors.values()])))

    @property
    def toml(self) -> str:
        """The material in a case file."""
        keys = {**self.constants, "law": self.law}.items()
        return "\n".join(["[material.rubber]", *(f"{key} = {toml_value(value)}" for key, value in keys)])


def read_tests(path: Path) -> dict[str, FloatArray]:
    """Stretches and nominal stresses (2, n) by test, of a CSV file with the columns test, stretch, stress.
    Raises RunError."""
    found: dict[str, list[tuple[float, float]]] = {}
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = csv.DictReader(stream)
            if not set(COLUMNS) <= set(rows.fieldnames or ()):
                raise RunError(f"{path}: needs the columns {', '.join(COLUMNS)}", "in the first line")
            for row in rows:
                test, place = (row["test"] or "").strip(), f"{path}:{rows.line_num}"
                if test not in TESTS:
                    raise RunError(f'{place}: there is no test "{test}"', f"one of {', '.join(TESTS)}")
                try:
                    pair = float(row["stretch"]), float(row["stress"])
                except (TypeError, ValueError) as error:
                    raise RunError(f"{place}: stretch and stress must be numbers") from error
                if not (0.0 < pair[0] < np.inf and np.isfinite(pair[1])):
                    raise RunError(f"{place}: stretches must be positive, stresses finite")
                found.setdefault(test, []).append(pair)
    except OSError as error:
        raise RunError(f"{path}: {error.strerror}") from error
    tests = {test: np.array(sorted(pairs)).T for test, pairs in found.items()}
    for test, (stretch, stress) in tests.items():
        if not ((stretch - 1.0) * stress > 0.0).any():
            raise RunError(f"{path}: {test}: no stress has the sign of its strain", "stretch 1 is undeformed")
    if not tests:
        raise RunError(f"{path}: no data")
    return tests


def fit(tests: Mapping[str, FloatArray], law: str, poisson: float = DEFAULT_NU) -> Fitted:
    """The constants of a law that represent the ``tests`` best, with its Poisson's ratio as one of them.
    Raises RunError."""
    # Only here: the import takes a third of a second.
    from scipy.optimize import least_squares

    every = [constant for constants in START[law].values() for constant in constants]
    # The shear modulus of the neo-Hookean law by linear least squares.
    unit = law_class("neo-hookean")(plane="strain", nu=0.25, E=2.5)
    pairs = [(stress_in(unit, test, stretch), stress) for test, (stretch, stress) in tests.items()]
    one, other = (np.concatenate(part) for part in zip(*pairs, strict=True))
    modulus = float(one @ other / (one @ one))
    scale = np.array([modulus if constant.modulus else 1.0 for constant in every])
    limits = [constant.least for constant in every], [constant.most for constant in every]

    def lacks(values: FloatArray) -> tuple[Hyperelastic, dict[str, FloatArray]]:
        made, found = law_class(law)(plane="strain", nu=poisson, **_keys(law, (values * scale).tolist())), {}
        for test, (stretch, stress) in tests.items():
            found[test] = (stress_in(made, test, stretch) - stress) / np.abs(stress).max()
        return made, found

    def differences(values: FloatArray) -> FloatArray:
        return np.concatenate([lack / np.sqrt(len(lack)) for lack in lacks(values)[1].values()])

    start = np.array([constant.start for constant in every])
    found = least_squares(differences, start, bounds=limits, x_scale=np.maximum(np.abs(start), 0.1))
    if not found.success:
        raise RunError(f"{law}: the constants did not converge", "give more data, or another law")
    made, remaining = lacks(found.x)
    errors, falling = {test: float(np.sqrt(np.mean(lack**2))) for test, lack in remaining.items()}, []
    for test, (stretch, _) in tests.items():
        between = np.linspace(stretch.min(), stretch.max(), POINTS)
        if (np.diff(stress_in(made, test, between)) < 0.0).any():
            falling.append(test)
    rounded = [float(f"{value:.6g}") for value in found.x * scale]
    return Fitted(law, {**_keys(law, rounded), "nu": poisson}, errors, falling)


def stress_in(law: Hyperelastic, test: str, stretch: FloatArray) -> FloatArray:
    """Nominal stress (n,) of a test at ``stretch`` (n,)."""
    side = {"uniaxial": stretch**-0.5, "equibiaxial": stretch, "planar": np.ones_like(stretch)}[test]
    return law.incompressible_stress(np.stack([stretch, side, 1.0 / (stretch * side)]))


def picture(path: Path, tests: Mapping[str, FloatArray], fitted: Sequence[Fitted]) -> None:
    panels = []
    for test, (stretch, stress) in tests.items():
        between = np.linspace(min(1.0, stretch.min()), stretch.max(), POINTS)
        curves = [Curve(stretch, stress, "measured", joined=False)]
        for one in fitted:
            law = law_class(one.law)(plane="strain", **one.constants)
            curves.append(Curve(between, stress_in(law, test, between), one.law, {"marker": ""}))
        panels.append(Panel(curves, f"stretch ({test})", "nominal stress"))
    draw(path, Picture(panels, legend="upper left", size=(3.4 * len(panels), 3.2), beside=True))


def fit_law(
    data: Path, laws: Sequence[str], image: Path | None = None, poisson: float = DEFAULT_NU
) -> list[Fitted]:
    """Fit ``laws`` to the tests of a file, best first, and draw them if asked for. Raises RunError."""
    tests = read_tests(data)
    found = sorted((fit(tests, law, poisson) for law in laws), key=lambda one: one.error)
    if image is not None:
        picture(image, tests, found)
    return found


def _keys(law: str, values: Sequence[float]) -> dict[str, Any]:
    rest = iter(values)
    found = {key: [next(rest) for _ in constants] for key, constants in START[law].items()}
    return found if law == "ogden" else {key: taken[0] for key, taken in found.items()}
