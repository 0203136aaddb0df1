"""Cloud, material and operators of one body, before its boundary conditions are set up."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.sight import Tips
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.elasticity import (
    XX,
    divergence_of,
    divergence_of_stress,
    divergence_rows,
    equilibrium_operator,
    operator_rows,
    point_rows,
    stress_of,
    stress_rows,
    stresses_at,
)
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.near_field import Isotropic, PointForceField, kernel_of
from mlsanm_cli.memo import digest
from mlsanm_cli.operators.neighbors import MlsSettings
from mlsanm_cli.operators.singular_functions import isolated_tips
from mlsanm_cli.operators.stencil_weights import Stencils, pair_rows, scalar_rows
from mlsanm_cli.operators.stencils import build_stencils, reflected
from mlsanm_cli.records import dataclass

INCOMPRESSIBLE_NEIGHBORS = 1.3
"""Factor on the stencil size of nearly incompressible materials."""

SECOND_SHARE = 0.05
"""Share of second derivatives in the equilibrium of materials that flow: with it the plastic stresses of a
body determine its strains (the response to them has the eigenvalues 0 to 1.02 of a projection), and nodal
stresses do not oscillate. docs/method.md, Plasticity."""
MIN_NODE_DISTANCE = 0.02
"""Nodes closer than this fraction of the spacing are rejected: only their difference distinguishes them."""
MIN_CORNER_ANGLE = 0.3
"""Interior angle (radians) below which corners may have no fit of degree 2, whatever the spacing."""


@dataclass(frozen=True)
class BodyModel:
    """Cloud, material and operators of one body. The cloud's points are the nodes, which carry the unknowns;
    ``stencils`` are theirs."""

    name: str
    cloud: Cloud
    material: PlaneMaterial
    settings: MlsSettings
    stencils: Stencils

    @classmethod
    def build(cls, name: str, cloud: Cloud, material: PlaneMaterial, settings: MlsSettings) -> BodyModel:
        """Build stencils with second derivatives at every node. Raises NumericalError if nodes are too close
        or a part is too thin."""
        distance = cloud.separation[0].min()
        if distance < MIN_NODE_DISTANCE:
            x, y = cloud.points[cloud.separation[0].argmin()]
            raise NumericalError(
                f"body {name}: two nodes near ({x:.6g}, {y:.6g}) are only {distance:.2g} "
                "of the spacing apart",
                "make the spacing smaller there, or leave out the short side, small arc or sharp tip",
            )
        settings = enough_neighbors(settings, material)
        nodes, tree, sight = cloud.fitted
        points, mirror = cloud.points, cloud.mirror
        points = points if mirror is None else points[mirror.own]
        tips = enriched_tips(cloud.tips, material, settings)
        try:
            stencils = build_stencils(nodes, tree, points, 2, settings, sight, tips, cloud.images)
        except NumericalError as error:
            corner = min(cloud.acute, key=cloud.acute.__getitem__, default=None)
            if corner is None or cloud.acute[corner] > MIN_CORNER_ANGLE:
                raise
            angle, (x, y) = np.degrees(cloud.acute[corner]), cloud.points[corner]
            where = f"body {name}: the corner of {angle:.3g} degrees at ({x:.6g}, {y:.6g}) is too acute"
            raise NumericalError(f"{where}: {error.message}", "round it, or cut its tip off") from error
        if mirror is not None:
            stencils = reflected(stencils, mirror)
        return cls(name, cloud, material, settings, stencils)

    @cached_property
    def tips(self) -> Tips | None:
        """Reentrant corners whose singular fields enrich the fits; None without any."""
        return enriched_tips(self.cloud.tips, self.material, self.settings)

    @cached_property
    def kernel(self) -> PointForceField:
        """Closed-form field of a surface force."""
        return kernel_of(self.material)

    @cached_property
    def content(self) -> str:
        """Digest of the nodes, the material and the operators' settings."""
        return model_key(self.name, self.cloud, self.material, self.settings)

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns."""
        return 2 * len(self.cloud.points)

    def stencils_at(self, points: FloatArray, order: int) -> Stencils:
        """Stencils at ``points`` (e, 2) with derivatives up to ``order``."""
        nodes, tree, sight = self.cloud.fitted
        own = self.cloud.images
        return build_stencils(nodes, tree, points, order, self.settings, sight, tips=self.tips, own=own)

    def probe_rows(self, points: FloatArray) -> sparse.csr_array:
        """Rows (5e | 6e, 2N) of displacement and stress at ``points`` (e, 2), by :func:`point_rows`."""
        return point_rows(self.stencils_at(points, 1), self.material, lambda: self.stencils)

    def field_rows(self, points: FloatArray) -> sparse.csr_array:
        """Rows (e, n) of a nodal field at ``points`` (e, 2)."""
        stencils = self.stencils_at(points, 0)
        return scalar_rows(stencils, np.ascontiguousarray(stencils.weights[:, 0]))

    def values_along(self, points: FloatArray, directions: FloatArray) -> sparse.csr_array:
        """Rows (e, 2N) of the displacement at ``points`` (e, 2) along ``directions`` (e, 2)."""
        stencils = self.stencils_at(points, 0)
        along = np.repeat(directions, np.diff(stencils.indptr), axis=0)
        return pair_rows(stencils, stencils.weights * along)

    def values(self, points: FloatArray, displacement: FloatArray) -> FloatArray:
        """The nodal ``displacement`` (N, 2) evaluated at ``points`` (e, 2)."""
        return self.stencils_at(points, 0).derivatives(displacement)[:, 0]

    def stress_around(self, centers: FloatArray, points: FloatArray) -> sparse.csr_array:
        """Rows (3 e t | 4 e t, 2N) of all stresses at ``points`` (e, t, 2) by polynomials of ``centers`` (e,
        2)."""

        def mean(even: FloatArray) -> sparse.csr_array:
            values = self.field_rows(points.reshape(-1, 2))
            return sparse.csr_array(values @ stress_rows(self.stencils, even, XX))

        (nodes, tree, sight), own, least = self.cloud.fitted, self.cloud.images, 1 - self.cloud.revolved
        fits = build_stencils(nodes, tree, points, 1, self.settings, sight, self.tips, own, centers, least)
        each = fits.of_each(points.shape[1])
        return sparse.csr_array(sparse.vstack(stresses_at(each, self.material, mean), format="csr"))

    def equilibrium(self, component: int) -> sparse.csr_array:
        """Rows (n, 2N) of div sigma in x (0) or y (1) at the nodes; see :attr:`nested`."""
        even, stencils = self.nested, self.stencils
        rest = self.material.stiffness - even
        operator = equilibrium_operator(rest, stencils.radius)[component]
        parts = [operator_rows(stencils, slice(0, 6), operator)] if rest.any() else []
        if even.any():
            stresses = [stress_rows(stencils, even, part) for part in range(len(even))]
            parts.append(divergence_rows(stencils, component) @ sparse.vstack(stresses, format="csr"))
        return sparse.csr_array(sum(parts[1:], parts[0]))

    @cached_property
    def nested(self) -> FloatArray:
        """Part (3 | 4, 3 | 4) of the stiffness whose stresses are differentiated as nodal fields.

        Nearly incompressible materials would lock: grad div u imposes two conditions per node and leaves too
        few isochoric displacements. There the mean pressure is a nodal field, one condition per node. Degree
        1, without second derivatives, has all stresses nodal. So do materials that flow, as their plastic
        stresses are nodal, except for a part ``SECOND_SHARE`` against oscillations.
        """
        c, settings = self.material.stiffness, self.settings
        if settings.degree == 1:
            return c
        even = self.material.bulk_part if self.material.nearly_incompressible else np.zeros_like(c)
        return even + (1.0 - SECOND_SHARE) * (c - even) if self.material.flows else even

    def stress(self, displacement: FloatArray) -> FloatArray:
        """Stress (n, 3 | 4) at the nodes, for nodal ``displacement`` (N, 2). The mean pressure of nearly
        incompressible materials is fitted to its nodal values: equilibrium controls only the fit."""
        c, derivatives = self.material.stiffness, self.stencils.derivatives(displacement)
        radius = self.stencils.radius
        if not self.material.nearly_incompressible:
            return stress_of(derivatives, c, radius)
        fitted = stress_of(derivatives, c - self.material.bulk_part, radius)
        return np.asarray(fitted + self.mean_stress(displacement))

    def mean_stress(self, displacement: FloatArray) -> FloatArray:
        """The part (n, 3) of :meth:`stress` that is fitted to nodal values."""
        derivatives, radius = self.stencils.derivatives(displacement), self.stencils.radius
        nodal = stress_of(derivatives, self.material.bulk_part, radius)
        return np.asarray(self.stencils.derivatives(nodal)[:, 0])

    def divergence_of(self, derivatives: FloatArray) -> FloatArray:
        """div sigma (n, 2) from ``derivatives`` (n, 6, 2) of a displacement, as by :meth:`equilibrium`."""
        even, radius = self.nested, self.stencils.radius
        rest = self.material.stiffness - even
        found = np.zeros((len(derivatives), 2))
        if rest.any():
            found += divergence_of(derivatives, rest, radius)
        return found + self.stress_divergence(stress_of(derivatives, even, radius)) if even.any() else found

    def stress_divergence(self, stress: FloatArray) -> FloatArray:
        """Divergence (n, 2) of nodal ``stress`` (n, 3) at the cloud's points."""
        return divergence_of_stress(self.stencils.derivatives(stress), self.stencils.radius)


def enriched_tips(tips: Tips | None, material: PlaneMaterial, settings: MlsSettings) -> Tips | None:
    """Reentrant corners with known singular fields: those of isotropic materials."""
    kernel = kernel_of(material)
    if tips is None or not settings.corners or material.flows or not isinstance(kernel, Isotropic):
        return None
    return isolated_tips(settings, replace(tips, kappa=kernel.kappa))


def enough_neighbors(settings: MlsSettings, material: PlaneMaterial) -> MlsSettings:
    """The settings with the stencil size the material needs, unless the case prescribes one."""
    if material.nearly_incompressible and settings.neighbors is None:
        return replace(settings, neighbors=math.ceil(INCOMPRESSIBLE_NEIGHBORS * settings.stencil_size))
    return settings


def model_key(name: str, cloud: Cloud, material: PlaneMaterial, settings: MlsSettings) -> str:
    """Digest of the arguments of :meth:`BodyModel.build`."""
    elastic = [material.stiffness, material.across, material.expansion, material.across_heat, material.flows]
    return digest(name, cloud.content, elastic, settings)
