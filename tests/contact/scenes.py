"""Contact scenes: synthetic condensed problems, and small ones built from a case."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.app.scene.assemble import assemble_bodies, prepare
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import parse_case
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.contact_state import ContactState
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.compressed import LinearMap
from mlsanm_cli.contact.response.condensation import condense
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.solve.condensed_scene import stage_factors
from tests.case_text import head, load


def synthetic(
    compliance: FloatArray,
    gap: FloatArray,
    load: FloatArray | None = None,
    balance: LinearMap | None = None,
    motion: FloatArray | None = None,
) -> Condensed:
    """A condensed problem without bodies: ``compliance`` (m, m), initial ``gap`` (m,), ``load`` (m, L).

    ``balance`` (k rows) and the gap per ``motion`` (m, k) come in where platens are wanted.
    """
    m = len(gap)
    load = np.zeros((m, 1)) if load is None else load
    motion = np.zeros((m, 0)) if motion is None else motion
    none = LinearMap.zeros(0, (load.shape[1], motion.shape[1], m, 0))
    weight = np.ones(m)
    return Condensed(
        pairings=(),
        spans={"contact": slice(0, m)},
        weight=weight,
        around=weight,
        half_plane=np.tile(np.eye(2), (m, 1, 1)),
        tangential={},
        friction_nodes=np.zeros(0, dtype=np.int64),
        friction=np.zeros(0),
        gap=LinearMap(gap, load, motion, compliance, np.zeros((m, 0))),
        slip=none,
        watched=none,
        balance=none if balance is None else balance,
        beyond=sparse.csr_array((0, 0)),
        quantities={"imbalance": {}},
        sources={},
        solutions={},
        solves=0,
        content="",
    )


def blocks_text(nu: float, upper: float, lower: float) -> str:
    """Two stacked blocks of these spacings."""
    return (
        head("strain")
        .material("steel", E=210e3, nu=nu)
        .body("upper", "steel", upper, box=([0.0, 2.0], [1.0, 2.0]))
        .body("lower", "steel", lower, box=([0.0, 2.0], [0.0, 1.0]))
        .support("lower.bottom", uy=0.0)
        .support("lower.left", ux=0.0)
        .support("upper.left", ux=0.0)
        .load("press", "upper.top", "platen", fy=-200.0)
        .contact("interface", "upper.bottom", "lower.top")
        .table("contact.regularization", law="exact")
    )


@dataclass(frozen=True)
class Small:
    """A scene condensed on its candidates, with the load factors of its last stage."""

    scene: Scene
    condensed: Condensed
    factors: FloatArray

    @property
    def pairing(self) -> Pairing:
        """Its only contact."""
        return self.condensed.pairings[0]

    @property
    def coordinate(self) -> FloatArray:
        """x of the candidates (m,)."""
        cloud = self.scene.bodies[self.pairing.slave_body].model.cloud
        return np.asarray(cloud.points[self.pairing.node[self.pairing.candidate], 0])

    def exact(self) -> ContactState:
        """Exact contact at full load."""
        return solve_exact(self.condensed, self.factors)

    def displacement(self, body: str, state: ContactState) -> FloatArray:
        """Nodal displacements (n, 2)."""
        unknowns = (state.factors, state.motion, state.pressure, np.zeros(0))
        found, worth = self.condensed.checked_displacements(self.scene, body, [unknowns])
        assert worth <= 1e-7
        return found[0]


def build(text: str, *overrides: str) -> Small:
    """Clouds, operators, factors and compliance of a case."""
    case = parse_case(text, Path("case.toml"), overrides).case
    boundaries = Boundaries.of(case)
    prepared = prepare(boundaries, clouds(boundaries), grids=False)
    scene = assemble_bodies(case, prepared, "auto")
    return Small(scene, condense(scene, prepared.pairings), stage_factors(case)[-1])


def blocks(ratio: float, nu: float, *overrides: str) -> Small:
    """Two blocks pressed together, node spacings 1 : ``ratio``."""
    return build(blocks_text(nu, 0.1, 0.1 * ratio), *overrides)


def cylinder(fine: float, *overrides: str, control: str = "force = [0.0, -226.566]") -> Small:
    """A half-disk of radius 1 on a block; a/R = 0.05 under the default force."""
    text = (
        head("strain")
        .material("steel", E=210e3, nu=0.3)
        .body("cylinder", "steel", 0.2)
        .table("body.shape", kind="half-disk", center=[0.0, 1.0], radius=1.0, side="lower")
        .item("body.refine", at=[0.0, 0.0], spacing=fine, radius=0.07)
        .body("block", "steel", 0.2, box=([-2.0, 2.0], [-2.0, 0.0]))
        .item("body.refine", at=[0.0, 0.0], spacing=fine, radius=0.07)
        .support("block.bottom", uy=0.0)
        .pin("block", [0.0, -2.0], ux=0.0)
        .add(f"{load('press', 'cylinder.flat', 'platen')}{control}\n")
        .contact("interface", "cylinder.arc", "block.top", reach=0.02)
    )
    return build(text, *overrides)
