"""What of a run is to be drawn, and the words that pictures share; of bodies the field shown, the deformation
scale, the detail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mlsanm_cli.app.results.path_lookup import level_at, pressures_at
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import Case, Temperature
from mlsanm_cli.cloud.membership import boundary_chords
from mlsanm_cli.cloud.sight import visibility_criterion
from mlsanm_cli.cloud.triangles import triangulate
from mlsanm_cli.contact.geometry.profile import THRESHOLD, unrolled
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.cloud import CloudBody
from mlsanm_cli.io.run_reader import BodyData, ContactData, RunData, SavedState
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.roundoff import FINE_ROUND_OFF

KINDS = ("pressure", "traction", "loop", "hysteresis", "force", "peak", "bodies", "line")
"""Kinds of pictures; hysteresis and line only come when they are asked for."""
OF_CONTACT = frozenset({"pressure", "traction", "loop", "hysteresis"})
FIELDS = {
    "von_mises": ("von Mises stress", "stress"),
    "xx": ("stress xx", "stress"),
    "yy": ("stress yy", "stress"),
    "xy": ("stress xy", "stress"),
    "ux": ("displacement in x", "length"),
    "uy": ("displacement in y", "length"),
    "displacement": ("displacement", "length"),
}
"""What a body can be coloured by and drawn along a line, its name and unit."""
MOST_LOADS = 3


@dataclass(frozen=True)
class Choice:
    """Which pictures: their kinds, all that there are by default; of which contact; coloured by which field;
    at which positions; along which line; into which file; moving or not."""

    what: tuple[str, ...] = ()
    contact: str | None = None
    field: str | None = None
    at: tuple[float, ...] = ()
    along: str | None = None
    out: Path | None = None
    animate: bool = False

    def wants(self, kind: str, contact: str = "") -> bool:
        """Whether a picture is wanted; of a ``contact`` if it is one's."""
        if self.contact is not None and (kind not in OF_CONTACT or contact != self.contact):
            return False
        if self.what:
            return kind in self.what
        if self.along is not None:
            return kind == "line"
        if self.field is not None:
            return kind == "bodies"
        return kind not in ("hysteresis", "line")


def refuse_nonsense(choice: Choice, runs: int) -> None:
    """RunError for choices that do not go together."""
    if choice.contact is not None and choice.what and not set(choice.what) & OF_CONTACT:
        raise RunError(
            f"--contact does not apply to {', '.join(choice.what)}",
            f"it applies to {', '.join(sorted(OF_CONTACT))}",
        )
    if "line" in choice.what and choice.along is None:
        raise RunError("a line is missing", "as in --along block.top or --along 0,0:0,-1")
    if choice.along is not None and choice.what and "line" not in choice.what:
        raise RunError("--along applies to --what line only", "omit --what, or write --what line")
    if choice.animate and (runs > 1 or choice.along is not None):
        raise RunError("--animate shows pressures or bodies of one run", "omit the other options")
    if runs > 1 and choice.out is None:
        raise RunError("several runs are drawn into one picture", "name its file, as in -o both.png")


def load_words(run: RunData, case: Case, position: float) -> str:
    """A position in words: the stage if there are several, and the factors of the loads that change in it."""
    stages = len(case.stage)
    number = min(max(int(np.ceil(position)), 1), stages)
    factors = dict(zip(run.path.factors, level_at(run, position).factors, strict=True))
    moving = [name for name in case.stage[number - 1] if name in factors][:MOST_LOADS]
    parts = [f"stage {number} of {stages}"] if stages > 1 else []
    return ", ".join([*parts, *(f"{name} x {factors[name]:.4g}" for name in moving)])


COMPONENTS = ("xx", "yy", "xy")
MAX_SHOWN_DISPLACEMENT = 0.05
"""Largest displacement shown, relative to the size of the scene."""
MAX_OVERLAP = 0.003
"""Largest overlap of touching surfaces due to enlarged displacements, relative to the size of the detail."""
DETAIL_HALF_WIDTHS = 2.5
"""Extent of the detail on both sides of the middle of the contact, in its half-widths."""
MIN_CLOSED_NODES, CLOSED_SPACINGS = 6, 1.5
"""A surface with at least so many nodes is closed if its last node is within so many spacings of the
first."""
MAX_DETAIL = 0.5
"""Part of the scene above which a contact needs no detail."""


def _von_mises(case: Case, body: str, fields: Mapping[str, FloatArray]) -> FloatArray | None:
    """Von Mises stress (n,) if it was saved or follows from stresses."""
    scalar = fields.get("von_mises")
    heated = any(isinstance(load, Temperature) and load.owner == body for load in case.load)
    finite = case.model.strain == "finite"
    if scalar is None and "stress" in fields and not heated and not finite:
        material = materials(case)[next(b.material for b in case.body if b.name == body)]
        scalar = von_mises(fields["stress"], material.out_of_plane_stress(fields["stress"]))
    # For a plane stiffness the out-of-plane stress is unknown.
    return None if scalar is None or np.isnan(scalar).any() else scalar


def field_of(
    case: Case, body: str, fields: Mapping[str, FloatArray], displacement: FloatArray, field: str | None
) -> tuple[FloatArray, str]:
    """A field (n,) of a body and its label with unit; by default von Mises stress, or else the magnitude of
    displacements. Raises RunError if it was not saved."""
    mises = _von_mises(case, body, fields)
    known = {} if mises is None else {"von_mises": mises}
    if "stress" in fields:
        known |= dict(zip(COMPONENTS, fields["stress"].T, strict=True))
    if "displacement" in fields or field is None:
        ux, uy = displacement.T
        known |= {"ux": ux, "uy": uy, "displacement": np.hypot(ux, uy)}
    chosen = field or ("displacement" if mises is None else "von_mises")
    label, kind = FIELDS[chosen]
    if chosen not in known:
        hint = "add the field that it is computed from to output.fields and run again"
        raise RunError(f"{label} was not saved", hint)
    return known[chosen], case.units.label(label, kind)


def shown_bodies(
    run: RunData, case: Case, state: SavedState, field: str | None
) -> tuple[list[CloudBody], str]:
    """All bodies in a saved state, coloured by a field, and its name with its unit. Raises as `field_of`."""
    bodies, label = [], ""
    for name, body in run.bodies.items():
        fields = state.bodies[name]
        displacement = fields.get("displacement", np.zeros_like(body.points))
        scalar, label = field_of(case, name, fields, displacement, field)
        bodies.append(CloudBody(body.points, displacement, scalar, triangles_of(body)))
    return bodies, label


def chosen_state(run: RunData, position: float | None) -> SavedState:
    """The state saved at a position, by default the last one. RunError where none is."""
    if position is None and run.states:
        return run.states[-1]
    wanted = max(run.path.position.tolist(), default=0.0) if position is None else position
    for state in run.states:
        if abs(state.position - wanted) <= FINE_ROUND_OFF * max(abs(wanted), 1.0):
            return state
    places = ", ".join(f"{state.position:g}" for state in run.states) or "(none)"
    raise RunError(f"fields are saved at position {places}, not at {wanted:g}", "name it in output.at")


def automatic_scale(run: RunData, bodies: Sequence[CloudBody]) -> float:
    """1, 2 or 5 times a power of ten by which displacements are multiplied to be seen; never below 1.
    Surfaces that met after closing a gap overlap in a picture by (scale - 1) times that gap, so scenes with
    curved contacts are drawn nearly to scale."""
    if run.is_finite:
        return 1.0
    size = _size(bodies)
    largest = max(float(np.hypot(*body.displacement.T).max(initial=0.0)) for body in bodies)
    if largest == 0.0:
        return 1.0
    limit = MAX_SHOWN_DISPLACEMENT * size / largest
    for contact in run.contacts.values():
        loaded = contact.pressure[-1] > THRESHOLD * contact.pressure[-1].max(initial=0.0)
        if not loaded.any():
            continue
        closed_gap = float(contact.gap[0][loaded].max())
        detail = DETAIL_HALF_WIDTHS * float(np.ptp(contact.points[loaded], axis=0).max())
        if closed_gap > 0.0:
            limit = min(limit, 1.0 + MAX_OVERLAP * detail / closed_gap)
    if limit < 2.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(limit))
    return float(power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= limit))


def contact_window(
    run: RunData, position: float, bodies: Sequence[CloudBody], scale: float
) -> tuple[float, float, float, float] | None:
    """The square (x0, x1, y0, y1) around the highest contact pressure; None if it is most of the scene. Its
    middle has moved as the node nearest to it is drawn, with displacements ``scale`` times as large."""
    if not run.contacts:
        return None
    pressures = pressures_at(run, position)
    name = max(pressures, key=lambda n: float(pressures[n].max(initial=0.0)))
    pressure = pressures[name]
    loaded = run.contacts[name].points[pressure > THRESHOLD * pressure.max(initial=0.0)]
    if len(loaded) < 2 or pressure.max() <= 0.0:
        return None
    low, high = loaded.min(axis=0), loaded.max(axis=0)
    half = DETAIL_HALF_WIDTHS * 0.5 * float((high - low).max())
    if not 0.0 < 2.0 * half <= MAX_DETAIL * _size(bodies):
        return None
    middle = 0.5 * (low + high)
    away = [np.hypot(*(body.points - middle).T) for body in bodies]
    nearest = int(np.argmin([one.min() for one in away]))
    x, y = (middle + scale * bodies[nearest].displacement[away[nearest].argmin()]).tolist()
    return x - half, x + half, y - half, y + half


def along_surface(contact: ContactData, pressure: FloatArray) -> tuple[IntArray, FloatArray]:
    """The nodes (m,) of a contact in the order in which they are drawn, and their arc lengths: those of a
    surface that closes around a body begin where pressures (m,) are furthest away."""
    arc, step = contact.arc_length, float(np.hypot(*(contact.points[-1] - contact.points[0])))
    if (
        len(arc) < MIN_CLOSED_NODES
        or step > CLOSED_SPACINGS * float(np.diff(arc).max())
        or MIN_CLOSED_NODES * step > arc[-1] - arc[0]
    ):
        return np.arange(len(arc)), arc
    return unrolled(arc, float(arc[-1] - arc[0]) + step, pressure)


def boundary_edges(body: BodyData) -> IntArray:
    """Pairs (b, 2) of neighbours along a body's boundary, loop by loop."""
    chords: IntArray = body.boundary_index[boundary_chords(body.boundary_index, body.boundary_name)]
    return chords


def triangles_of(body: BodyData) -> IntArray:
    """Triangles (t, 3) of a stored body's points that fill it."""
    edges = boundary_edges(body)
    return triangulate(body.points, edges, visibility_criterion(body.points, edges))


def _size(bodies: Sequence[CloudBody]) -> float:
    points = np.concatenate([body.points for body in bodies])
    return float(np.ptp(points, axis=0).max())
