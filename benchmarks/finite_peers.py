"""Finite strain against scikit-fem at equal error: CPU seconds of a bent cantilever and a deep cylinder.

    pip install scikit-fem
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/finite_peers.py

The cases are cases/bent_cantilever.toml and cases/deep_cylinder.toml. scikit-fem has nine-node quads, total
Lagrangian, Newton's method in as few increments as converge, SuperLU, and pressures of the cylinder by
augmented penalties. Of its meshes the coarsest counts whose error is not above ours,
or not above that of the references, or the finest. Times are CPU seconds of the process without imports, in
pairs, medians of three.
"""

from __future__ import annotations

import statistics
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad

import mlsanm_cli as mlsanm

CASES = Path(__file__).parent.parent / "cases"
TIP, FORCE = 0.8253, 0.7012 / 2.0
"""Deflection over the length, and the force on half of the cylinder: docs/results.md."""
KNOWN = 1e-4
"""References are good to so much."""
REPEATS, TOLERANCE, MOST = 3, 1e-8, 25
RADIUS, DEPTH, PENALTY, AUGMENTED = 1.0, 0.3, 200.0, 3

Array = NDArray[np.float64]
Law = Callable[[Array, Array], tuple[Array, Array]]


def neo_hookean(lam: float, mu: float) -> Law:
    """Stress by a deformation gradient (2, 2, ...), and its derivative times a change of it."""

    def law(f: Array, h: Array) -> tuple[Array, Array]:
        volume = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
        inverse = np.array([[f[1, 1], -f[1, 0]], [-f[0, 1], f[0, 0]]]) / volume
        factor = lam * np.log(volume) - mu
        turned = np.einsum("ij...,kj...,kl...->il...", inverse, h, inverse)
        rate = lam * np.einsum("ij...,ij...->...", inverse, h) * inverse - factor * turned
        return mu * f + factor * inverse, mu * h + rate

    return law


def venant_kirchhoff(lam: float, mu: float) -> Law:
    """The same."""
    one = np.eye(2)[:, :, None, None]

    def stress(e: Array) -> Array:
        return lam * np.einsum("ii...->...", e) * one + 2.0 * mu * e

    def law(f: Array, h: Array) -> tuple[Array, Array]:
        s = stress(0.5 * (np.einsum("ki...,kj...->ij...", f, f) - one))
        rate = np.einsum("ki...,kj...->ij...", f, h)
        ds = stress(0.5 * (rate + np.swapaxes(rate, 0, 1)))
        product = "ij...,jk...->ik..."
        return np.einsum(product, f, s), np.einsum(product, h, s) + np.einsum(product, f, ds)

    return law


class Solid:
    """A body on a mesh, and Newton's method on it."""

    def __init__(self, mesh: MeshQuad, law: Law, held: Callable[[Any], Array]) -> None:
        self.element = ElementVector(ElementQuad2())
        self.basis = Basis(mesh, self.element, intorder=4)
        self.free = np.setdiff1d(np.arange(self.basis.N), held(self.basis))
        one = np.eye(2)[:, :, None, None]
        contract = "ij...,ij...->..."

        @BilinearForm
        def tangent(u: Any, v: Any, w: Any) -> Any:
            return np.einsum(contract, law(one + w["now"].grad, u.grad)[1], v.grad)

        @LinearForm
        def inner(v: Any, w: Any) -> Any:
            return np.einsum(contract, law(one + w["now"].grad, 0.0 * w["now"].grad)[0], v.grad)

        self.forms = tangent, inner

    def solve(self, u: Array, load: Array, more: Callable[[Array], tuple[Any, Array]] | None = None) -> Array:
        """The state under a load, from another one; ArithmeticError where Newton's method does not end."""
        u = u.copy()
        for _ in range(MOST):
            now = self.basis.interpolate(u)
            stiffness, rest = (form.assemble(self.basis, now=now) for form in self.forms)
            rest = rest - load
            if more is not None:
                added, force = more(u)
                stiffness, rest = stiffness + added, rest + force
            factor = splu(stiffness[self.free][:, self.free].tocsc(), permc_spec="MMD_AT_PLUS_A")
            change = factor.solve(-rest[self.free])
            u[self.free] += change
            if not np.isfinite(change).all():
                break
            if np.abs(change).max() <= TOLERANCE * max(1.0, float(np.abs(u).max())):
                return u
        raise ArithmeticError


def increments(step: Callable[[Array, float], Array], start: Array) -> Array:
    """The end of a path by the fewest even increments that converge."""
    for count in (5, 10, 20):
        try:
            with np.errstate(all="ignore"):
                u = start
                for part in np.arange(1, count + 1) / count:
                    u = step(u, float(part))
            return u
        except (ArithmeticError, RuntimeError):
            continue
    raise ArithmeticError


def cantilever(across: int) -> float:
    """The deflection of the tip over the length."""
    x, y = np.linspace(0.0, 10.0, 10 * across + 1), np.linspace(0.0, 1.0, across + 1)
    mesh = MeshQuad.init_tensor(x, y)
    solid = Solid(mesh, venant_kirchhoff(0.0, 600.0), lambda b: b.get_dofs(lambda x: x[0] < 1e-9).all())
    tip = FacetBasis(mesh, solid.element, facets=mesh.facets_satisfying(lambda x: x[0] > 10.0 - 1e-9))
    load = LinearForm(lambda v, w: 60.0 * w.x[1] * (1.0 - w.x[1]) * v[1]).assemble(tip)
    u = increments(lambda u, part: solid.solve(u, part * load), np.zeros(solid.basis.N))
    return float((solid.basis.probes(np.array([[10.0], [0.5]])) @ u)[1]) / 10.0


def cylinder(fine: int) -> float:
    """The force on half of the cylinder."""
    near, far = (
        np.linspace(0.0, 0.75, fine + 1),
        0.75 + 1.25 * np.linspace(0.0, 1.0, fine // 2 + 1)[1:] ** 1.4,
    )
    x = np.concatenate([near, 0.75 + 1.25 * far**1.4])
    mesh = MeshQuad.init_tensor(x, (2.0 - x)[::-1])
    lam, mu = 2.6 * 0.3 / (1.3 * 0.4), 1.0
    held = lambda b: np.union1d(  # noqa: E731
        b.get_dofs(lambda x: x[1] < 1e-9).all(), b.get_dofs(lambda x: x[0] < 1e-9).all("u^1")
    )
    solid = Solid(mesh, neo_hookean(lam, mu), held)
    top = FacetBasis(
        mesh, solid.element, intorder=8, facets=mesh.facets_satisfying(lambda x: x[1] > 2.0 - 1e-9)
    )

    def pressure(w: Any) -> tuple[Array, Array, Array]:
        away = w.x + w["now"].value - np.array([0.0, 3.0 - float(w["depth"])])[:, None, None]
        size = np.hypot(*away)
        return np.maximum(w["before"] - PENALTY * (size - RADIUS), 0.0), away / size, size

    @BilinearForm
    def stiffness(u: Any, v: Any, w: Any) -> Any:
        p, n, size = pressure(w)
        un, vn = (one[0] * n[0] + one[1] * n[1] for one in (u, v))
        return PENALTY * (p > 0.0) * un * vn - p / size * (u[0] * v[0] + u[1] * v[1] - un * vn)

    @LinearForm
    def pressed(v: Any, w: Any) -> Any:
        p, n, _ = pressure(w)
        return -p * (v[0] * n[0] + v[1] * n[1])

    before = np.zeros(top.dx.shape)

    def given(u: Array, depth: float) -> dict[str, Any]:
        return {"now": top.interpolate(u), "depth": depth, "before": before}

    def contact(u: Array, depth: float) -> tuple[Any, Array]:
        return stiffness.assemble(top, **given(u, depth)), pressed.assemble(top, **given(u, depth))

    def step(u: Array, part: float) -> Array:
        return solid.solve(u, np.zeros(len(u)), lambda now: contact(now, part * DEPTH))

    u = increments(step, np.zeros(solid.basis.N))
    for _ in range(AUGMENTED):
        places = top.global_coordinates().value + top.interpolate(u).value
        away = np.hypot(places[0], places[1] - 3.0 + DEPTH)
        before = np.maximum(before - PENALTY * (away - RADIUS), 0.0)
        u = step(u, 1.0)
    return float(contact(u, DEPTH)[1][top.get_dofs().all("u^2")].sum())


def ours(case: str) -> float:
    """The same figure of this program."""
    with tempfile.TemporaryDirectory() as place, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = mlsanm.run(CASES / case, out=Path(place) / "run").summary
    if case.startswith("bent"):
        return float(found["probes"]["end"]["displacement"][1]) / 10.0
    return -float(found["forces"]["press"][1])


def timed(solve: Callable[[], float]) -> tuple[float, float]:
    """What it gives, and the CPU seconds it takes."""
    begun = time.process_time()
    value = solve()
    return value, time.process_time() - begun


def compared(case: str, exact: float, peer: Callable[[int], float], meshes: Sequence[int]) -> None:
    """Print one row."""
    ours(case)
    error = max(abs(ours(case) / exact - 1.0), KNOWN)
    mesh = next((one for one in meshes if abs(peer(one) / exact - 1.0) <= error), meshes[-1])
    pairs = [(timed(lambda: ours(case)), timed(lambda: peer(mesh))) for _ in range(REPEATS)]
    mine, theirs = (statistics.median(pair[k][1] for pair in pairs) for k in (0, 1))
    off = abs(pairs[0][1][0] / exact - 1.0)
    print(f"{case}: error {error:.1e}, {mine:.2f} s; scikit-fem, mesh {mesh}: {off:.1e}, {theirs:.2f} s")


if __name__ == "__main__":
    compared("bent_cantilever.toml", TIP, cantilever, (1, 2, 3, 4))
    compared("deep_cylinder.toml", FORCE, cylinder, (16,))
