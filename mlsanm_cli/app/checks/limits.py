"""Limits of the checks of a run, by name: the levels above which it warns or fails, what the value of a check
is, and what to do. ``docs/troubleshooting.md`` shows this table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mlsanm_cli.solve.direction_updates import INSTABILITY_RATIO


@dataclass(frozen=True)
class Limit:
    """Levels of a check: a run warns above ``warns`` and fails above ``fails`` (with ``lower``, below them),
    never for None. ``meaning`` defines the value that is compared, ``remedy`` what reduces it."""

    warns: float | None
    fails: float | None
    meaning: str
    remedy: str
    lower: bool = False

    @property
    def first(self) -> float | None:
        """The level that is reached first."""
        return self.fails if self.warns is None else self.warns


COUNT = 0.0
"""Level of checks whose value is a number of places."""

LIMITS: Mapping[str, Limit] = {
    # The model, before the path.
    "node_distance": Limit(
        0.5,
        None,
        "smallest distance of two nodes over the local spacing; closer nodes make stencils ill-conditioned",
        "a lower `growth`, another `seed`, or more even nodes in the file",
        lower=True,
    ),
    "node_hole": Limit(
        1.6,
        None,
        "radius of the largest circle without nodes over the local spacing, about 1.1 in good clouds; larger "
        "ones make stencils one-sided",
        "a lower `growth`, a smaller `spacing`, or more even nodes in the file",
    ),
    "spacing_growth": Limit(
        0.3, None, "growth of the spacing per unit length", "a lower `growth` in `[[body.refine]]`"
    ),
    "mesh_growth": Limit(
        0.6,
        None,
        "growth of the spacing per unit length between nodes of a file; good meshes have up to 0.5",
        "more even nodes in the file",
    ),
    "facing_spacings": Limit(
        2.0,
        None,
        "ratio of the spacings of two surfaces that face each other, in contacts with nodal pressures",
        "bring the spacings of the two surfaces closer together",
    ),
    "slave_stiffness": Limit(
        3.0,
        None,
        "stiffness of the slave over that of the master, in contacts with nodal pressures",
        "exchange slave and master",
    ),
    "contact_corner": Limit(
        COUNT,
        None,
        "corners inside a contact surface, where contact grids end, as of a disk in a groove",
        "a contact for each side of the corner",
    ),
    "crack_tip": Limit(
        COUNT,
        None,
        "ends of a contact at which a bond of the same bodies begins",
        "do not use the pressures of the nodes next to it, nor the peak: they depend on the spacing",
    ),
    "bonded_curve": Limit(
        0.22,
        None,
        "rotation of a bonded surface from node to node (radian); errors of bonds are not estimated",
        "a smaller spacing there, at least 25 nodes on a full circle",
    ),
    "degree": Limit(2.0, None, "`mls.degree` of a body; 1 is for comparisons only", "use 2 or 4", lower=True),
    "initial_gap": Limit(
        0.25,
        None,
        "initial gap of a contact over the size of the smaller body",
        "move the bodies together, unless they are meant to move so far; check the units",
    ),
    "load_resolution": Limit(
        0.08,
        None,
        "error of linear interpolation of a load between nodes over its largest value",
        "`refine` there, or use a smoother expression. Automatic spacings resolve everything except "
        "discontinuities inside a body; for a temperature that is discontinuous along a line, define two "
        "bodies and bond them",
    ),
    "loaded_length": Limit(
        0.01,
        None,
        "relative error of the length of a loaded part of a boundary whose nodes come from a file",
        "nodes of the file at `from` and `to`, or an expression",
    ),
    "weak_motion": Limit(
        COUNT,
        None,
        "motions that follow the surfaces in contact and are hardly resisted",
        "fix the motion with a `[[support]]`, or prescribe it",
    ),
    "reentrant_corners": Limit(
        COUNT,
        None,
        "sharp corners of a body that point into the material, where stresses are singular and computed "
        "values depend on the spacing",
        "define a `rounding`",
    ),
    "plane_stiffness": Limit(
        COUNT,
        None,
        "plane stiffnesses in plane strain, which do not determine the stress out of the plane",
        "give E1, E2, G12, nu12 and the constants of the third axis",
    ),
    "friction_coefficient": Limit(
        4.0, None, "coefficient of friction; that of rubber is up to 4", "it may be a percentage"
    ),
    "holonomic_reversal": Limit(
        COUNT, None, "loads that reverse, with a friction law without memory", '`friction_law = "memory"`'
    ),
    "refinement_pass": Limit(
        COUNT,
        None,
        "failed passes of a refinement; the results are those of the pass before",
        "finer initial clouds, or fewer passes",
    ),
    # Every state of the path.
    "residual": Limit(
        None,
        None,
        "residual of the contact problem; the limit is `solver.tolerance`",
        "the path of the hyperbolic law does not reach the tolerance: increase "
        "`contact.NAME.regularization.eta`, or use the exact law",
    ),
    "finite": Limit(None, COUNT, "numbers of a state that are not finite", "finer nodes, or smaller loads"),
    "friction_limit": Limit(
        None,
        1e-8,
        "excess of tractions over their friction limits over the peak pressure (with the hyperbolic law "
        "0.001 eta)",
        'lower `solver.tolerance`, or use `law = "exact"`',
    ),
    "contact_reach": Limit(
        None,
        COUNT,
        "nodes left out of a contact that have come into contact",
        "a contact moves or opens on its way: add the position to `output.at`, so that it is found there in "
        "advance; or a larger `reach`",
    ),
    "overlap": Limit(
        None,
        COUNT,
        "boundaries inside another body or an obstacle without a contact there",
        "a `[[contact]]` between them, or further boundaries in an existing one; or draw them farther apart",
    ),
    "self_overlap": Limit(
        COUNT,
        None,
        "bodies whose boundary overlaps itself; a run at finite strain fails",
        "self-contact is not supported: use smaller loads, or two bodies",
    ),
    "sliding_distance": Limit(
        0.25,
        None,
        "distance by which surfaces slide along each other over the width of their contact, at small strain",
        '`model.strain = "finite"`',
    ),
    "snap": Limit(
        COUNT,
        None,
        "jumps of a contact with friction: there is no continuous path",
        "the following state is one of several possible ones: prescribe displacements instead of forces",
    ),
    "body_rotation": Limit(
        0.03,
        INSTABILITY_RATIO,
        "moment of forces at their displaced positions over the one that resists the rotation of a body; "
        "where nothing resists it the body rolls away or tips over",
        "hold the body, or press it from two sides: contacts at small strain press where they are drawn",
    ),
    "volume_ratio": Limit(
        None,
        0.0,
        "least determinant of the deformation gradient at a node, at finite strain",
        "smaller loads, or finer nodes there",
        lower=True,
    ),
    "ellipticity": Limit(
        0.1,
        0.0,
        "least eigenvalue of the acoustic tensor over the shear modulus, at finite strain",
        '`law = "neo-hookean"`, which admits any compression, or smaller loads',
        lower=True,
    ),
    # The end of the path.
    "linear_residual": Limit(
        None,
        1e-6,
        "relative change of an elastic solution by one more iterative refinement",
        "more equal spacings, a lower `mls.degree`, or a Poisson's ratio less close to 0.5",
    ),
    "pressed_spacings": Limit(
        None,
        4.0,
        "ratio of the spacings of two surfaces where they press on each other, with nodal pressures",
        "refine the coarser surface in the contact",
    ),
    "initial_overlap": Limit(
        0.01,
        None,
        "pressures before any load over those at the end of the path, where surfaces are drawn overlapping",
        "draw them touching, or define a press fit by `interference`",
    ),
    "contact_end": Limit(
        0.2,
        None,
        "pressure at an end of a contact where its surface continues smoothly, over the mean pressure",
        "add the continuing boundary to the contact",
    ),
    "peak_pressure": Limit(
        0.5,
        None,
        "peak pressure of a contact, off its ends, over the contact modulus: no material carries more",
        "at a sharp rigid tip or edge the pressure is unbounded and depends on the grid: judge by forces, or "
        "round the tip; or the units of E and of the loads differ",
    ),
    "strain": Limit(
        0.1,
        None,
        "strain or rotation of a body at small strain; the error of a linear model is of the same order",
        "often the units are inconsistent: E in MPa needs mm and N",
    ),
    "force_mismatch": Limit(
        0.03,
        0.1,
        "difference of the forces on slave and master of a contact over its normal force",
        "bring the spacings of the two surfaces closer together, or use finer nodes",
    ),
    "force_balance": Limit(
        0.03,
        0.1,
        "sum of all forces on a body over the largest of them; reactions are computed from stresses, "
        "independently of the applied forces",
        "finer nodes at supports and notches, or `mls.degree = 4`",
    ),
    "energy_error": Limit(
        0.03,
        0.1,
        "twice the strain energy of a body over the work done on it, minus 1; on beams it is the error of "
        "the deflection. At finite strain the work of stresses less that of forces over the energy",
        "finer nodes, at least five across thin parts in bending, or `mls.degree = 4`",
    ),
    "series_energy_error": Limit(
        0.01,
        0.1,
        "the energy error of a path by power series at finite strain",
        "finer nodes, at least five across thin parts in bending",
    ),
    "single_nodes": Limit(
        0.03,
        None,
        "increase of the displacements by a force on a single node when the spacing is halved: next to it "
        "they are unbounded",
        "support a part of a boundary (`from`, `to`) or a small hole, or measure displacements relative to "
        "another point than the fixed one",
    ),
    "peak_stress": Limit(
        0.03,
        None,
        "estimated error of the largest stress on the free boundary of a body",
        "finer nodes there, 14 over the radius of a hole",
    ),
    "held_motion": Limit(
        0.01,
        None,
        "part of a contact force that acts along a motion without stiffness that is fixed at 0",
        "a `[[support]]` in that direction, or friction",
    ),
    "limit_load": Limit(
        0.01,
        None,
        "part of a limit load that is due to contacts that do not move along the surface of a rotated body",
        'stiffer bodies or smaller loads, which turn less; or `model.strain = "finite"`, which follows the '
        "contacts",
    ),
    "no_pressure": Limit(
        COUNT,
        None,
        "scenes without contact pressure at the end of any stage",
        "check the direction and the size of the loads",
    ),
    "polish": Limit(
        0.1,
        None,
        "relative change of pressures or tractions by polishing; between saved levels the path of the "
        "hyperbolic law deviates as much from the exact one",
        "a lower `contact.regularization.eta`",
    ),
    "missing_estimates": Limit(
        COUNT,
        None,
        "missing error estimates, as for thin parts with three nodes across, or for `mls.degree` 1, 5 and 6",
        "follow the hint, or compare with a run of half the spacings",
    ),
    "displacement_error": Limit(
        0.02,
        None,
        "estimated error of displacements, of the whole or at a probe",
        "halve the spacing named, or use `[adapt]`",
    ),
    "law_error": Limit(
        0.02,
        None,
        "part of the displacements that is due to the regularised contact law, on which lightly loaded "
        "bodies float",
        '`law = "exact"`, or a lower `eta`',
    ),
    "force_error": Limit(
        0.005,
        None,
        "estimated error of the force of a contact over the sum of its pressures",
        "finer nodes, above all where bodies are held",
    ),
    "pressure_error": Limit(
        0.02,
        None,
        "estimated error of the pressures of a frictionless contact with a contact grid (L2 norm)",
        "finer nodes in the bodies, or `[adapt]`",
    ),
    "rough_pressure_error": Limit(
        0.05,
        None,
        "estimated error of the pressures of other contacts (L2 norm)",
        "finer nodes where the bodies touch, a smaller `contact.NAME.accuracy`, or `[adapt]`",
    ),
    "energy_estimate": Limit(
        0.015,
        None,
        "estimated error of the energy at finite strain; forces may be as far off",
        "refine where the message says, with slow `growth`",
    ),
    "finite_force_error": Limit(
        0.015,
        None,
        "estimated error of the force of a contact over the largest force, at finite strain",
        "finer nodes where the bodies touch",
    ),
    "few_contact_nodes": Limit(
        4.0,
        None,
        "nodes in a contact at finite strain, next to open ones of a smooth surface at least 6",
        "finer nodes where the bodies touch, or automatic spacings",
        lower=True,
    ),
    "contact_between_nodes": Limit(
        COUNT,
        None,
        "contacts that press, or may touch, between nodes, at finite strain",
        "finer nodes there",
    ),
    "contact_nodes": Limit(
        COUNT,
        None,
        "contacts with fewer nodes than their `accuracy` requires, at finite strain",
        "raise `contact.accuracy`, or refine where bodies touch with `body.refine`",
    ),
}


def level(name: str) -> float:
    """The first level of a check that has one."""
    found = LIMITS[name].first
    assert found is not None
    return found
