"""Curves of runs as pictures: pressures and tractions along contacts, loops, the load path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.app.checks.references import profile_on
from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.path_lookup import (
    along_surface,
    checked_error,
    contact_force,
    level_at,
    mean_tangent,
    pressures_at,
    tangential_force,
)
from mlsanm_cli.arrays import runs_of
from mlsanm_cli.case import Case, Platen
from mlsanm_cli.case.model.motions import ObstacleMotion
from mlsanm_cli.contact.complementarity.problem import SLIP, STICK
from mlsanm_cli.contact.geometry.profile import regular_peak
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.plots.curves import (
    OUTSIDE,
    Curve,
    Panel,
    Picture,
    cut_off_above,
    node_marks,
    shades,
    visible_range,
)
from mlsanm_cli.io.plots.figures import COLOURS, REFERENCE_LINE
from mlsanm_cli.io.run_reader import RunData
from mlsanm_cli.io.schema import force_on_slave
from mlsanm_cli.roundoff import ROUND_OFF

MAX_LEVELS = 6
"""More load levels in one picture cannot be distinguished."""
MIN_TANGENTIAL_MOTION = 1e-3
"""Tangential displacement of a platen, relative to the slip, below which a loop is drawn over the slip."""
ZONES = {STICK: ("stick", COLOURS[2]), SLIP: ("slip", COLOURS[1])}
POSITION = "position on the load path (stages)"
TANGENTIAL = "tangential force on the master, per unit thickness"
SLIP_LABEL = "mean slip of the surfaces"


def load_words(run: RunData, case: Case, position: float) -> str:
    """The stage of a position if there are several, and the factors of three loads that change in it."""
    stages = len(case.stage)
    number = min(max(int(np.ceil(position)), 1), stages)
    factors = dict(zip(run.path.factors, level_at(run, position).factors, strict=True))
    moving = [name for name in case.stage[number - 1] if name in factors][:3]
    parts = [f"stage {number} of {stages}"] if stages > 1 else []
    return ", ".join([*parts, *(f"{name} x {factors[name]:.4g}" for name in moving)])


def position_words(run: RunData, case: Case, position: float) -> str:
    return ", ".join(filter(None, (f"position {position:.4g}", load_words(run, case, position))))


def pressure_picture(run: RunData, case: Case, name: str, choice: Choice) -> Picture:
    """Pressures along a contact at several positions; at the end of the path with the closed formula named by
    the case and the difference from it in percent of its peak."""
    contact, end = run.contacts[name], float(run.path.position[-1])
    levels = list(choice.at)
    if not levels:
        saved = sorted({state.position for state in run.states if 0.0 < state.position < end})
        if len(saved) >= MAX_LEVELS:
            saved = [saved[i] for i in np.linspace(0, len(saved) - 1, MAX_LEVELS - 1).round().astype(int)]
        levels = [*saved, end]
    pressure = np.stack([pressures_at(run, level)[name] for level in levels])
    high = max(regular_peak(contact.arc_length, values) for values in pressure)
    profile, formula, loaded = None, None, None
    # The force of the pressures: Hertz' formula knows no tractions. Finite strain has no reference.
    force = float(np.hypot(*force_on_slave(contact.weight, contact.normal, contact.pressure[-1])))
    if case.reference is not None and force > 0.0 and levels[-1] == end:
        described = next(one for one in case.contact if one.name == name)
        profile = profile_on(case, described, contact.points, contact.normal, contact.pressure[-1], force)
    if profile is None:
        order, arc = along_surface(contact, pressure.max(axis=0))
        pressure = pressure[:, order]
    else:
        arc, half = profile.coordinate, profile.half_width
        # The curve includes the ends of the loaded part, however far the candidates extend.
        ends = [end for end in (-half, half) if arc[0] < end < arc[-1]]
        x = np.union1d(np.linspace(arc[0], arc[-1], 801), ends)
        label = {"Hertz": "Hertz, closed formula"}.get(profile.label, "uniform pressure")
        formula = Curve(x, profile.curve(x), label, REFERENCE_LINE)
        loaded = x[formula.y > 0.0]
    limits = visible_range(arc, pressure, loaded)
    shown = (arc >= limits[0]) & (arc <= limits[1])
    look = {"marker": "o", **node_marks(int(shown.sum()))}
    curves = [
        Curve(arc[shown], values[shown], f"position {level:.4g}", {"color": colour, **look})
        for colour, level, values in zip(shades(len(levels)), levels, pressure, strict=True)
    ]
    low = float(pressure[:, shown].min(initial=0.0))
    high, cut_off = cut_off_above(float(pressure.max(initial=0.0)), high)
    y_limits = min(0.0, 1.05 * low), 1.05 * high if high > 0.0 else None
    x_label = case.units.label("arc length" if formula is None else "distance from the middle", "length")
    panel = Panel(curves, x_label, case.units.label("pressure", "stress"), limits, y_limits, cut_off=cut_off)
    alone = len(levels) == 1 and formula is None
    words = load_words(run, case, levels[-1]) if len(levels) == 1 else ""
    title = ", ".join(filter(None, ("Contact pressure", name, curves[0].label if alone else "", words)))
    if formula is None:
        return Picture([panel], title, "" if alone else OUTSIDE)
    expected = np.interp(arc[shown], formula.x, formula.y, left=0.0, right=0.0)
    difference = 100.0 * (curves[-1].y - expected) / (float(np.abs(formula.y).max()) or 100.0)
    zero = Curve(np.array(limits), np.zeros(2), look=REFERENCE_LINE)
    lower = [zero, Curve(arc[shown], difference, look=curves[-1].look)]
    below = Panel(lower, x_label, "difference\n[% of peak]", limits)
    return Picture([panel._replace(curves=[*curves, formula]), below], title, OUTSIDE, (7.2, 4.8))


def traction_picture(run: RunData, case: Case, name: str, choice: Choice) -> Picture:
    """The traction at the nodes of a contact with its friction limits, and the stick and slip zones."""
    contact = run.contacts[name]
    friction = next(described.coefficient for described in case.contact if described.name == name)
    # Bonds have no friction limit.
    coefficient = friction if np.isfinite(friction) else 0.0
    position = choice.at[-1] if choice.at else float(run.path.position[-1])
    level = level_at(run, position)
    checked_error(run, level, "pressures", contact.pressure, contact.traction)
    keys = "pressure", "traction", "status"
    pressure, traction, status = (level[f"contacts/{name}/{key}"] for key in keys)
    pressure = np.maximum(pressure, 0.0)
    most = np.maximum(coefficient * pressure, np.abs(traction))
    order, arc = along_surface(contact, pressure)
    limit, traction, status = coefficient * pressure[order], traction[order], status[order]
    # Zones end half-way between nodes.
    borders, zones = np.concatenate([arc[:1], 0.5 * (arc[1:] + arc[:-1]), arc[-1:]]), []
    for kind, (label, colour) in ZONES.items() if len(arc) > 1 else ():
        for first, last in runs_of(status == kind):
            zones.append((float(borders[first]), float(borders[last]), colour, label))
            label = ""
    high, cut_off = cut_off_above(float(most.max(initial=0.0)), regular_peak(contact.arc_length, most))
    limits = (-1.05 * high, 1.05 * high) if high else (None, None)
    upper = Curve(arc, limit, "friction limit", REFERENCE_LINE)
    own = Curve(arc, traction, "traction", {"color": COLOURS[0], "marker": "o", "markersize": 2.5})
    labels = case.units.label("arc length", "length"), case.units.label("traction on the slave", "stress")
    seen = visible_range(arc, limit[None, :])
    panel = Panel([upper, Curve(arc, -limit, "", REFERENCE_LINE), own], *labels, seen, limits, zones, cut_off)
    return Picture([panel], f"Tangential traction, {name}, {position_words(run, case, position)}", OUTSIDE)


def loop_picture(run: RunData, case: Case, name: str, choice: Choice, over_slip: bool = False) -> Picture:
    """The tangential force on the master over the displacement of the platen that moves most, or the slip."""
    force, tangent = tangential_force(run, name), mean_tangent(run, name)
    if not force.any():
        raise RunError(f"contact {name} transmits no tangential force", "use --what pressure or traction")
    along = {load: moved @ tangent for load, moved in run.path.displacements.items()}
    contact = run.contacts[name]
    moved, label = contact.slip @ contact.weight / contact.weight.sum(), SLIP_LABEL
    # Of several loads on one plate the one that prescribes most along the tangent.
    prescribed = {
        load.name: abs(sum(value * tangent["xy".index(axis)] for axis, (_, value) in load.control.items()))
        for load in case.load
        if isinstance(load, Platen | ObstacleMotion)
    }
    ranges = {load: float(np.ptp(values)) for load, values in along.items()}
    most = max(ranges.values(), default=0.0)
    equal = [name for name, size in ranges.items() if size >= (1.0 - ROUND_OFF) * most]
    load = max(equal, key=lambda name: prescribed.get(name, 0.0), default="")
    if load and not over_slip and most > MIN_TANGENTIAL_MOTION * float(np.ptp(moved)):
        moved, label = along[load], f"displacement along the contact, by {load}"
    start = {"color": COLOURS[1], "marker": "s", "linestyle": "none"}
    end = {"color": COLOURS[2], "marker": "^", "linestyle": "none"}
    ends = Curve(moved[:1], force[:1], "start", start), Curve(moved[-1:], force[-1:], "end", end)
    look = {"color": COLOURS[0], "marker": "o", "markersize": 2.0}
    labels = case.units.label(label, "length"), case.units.label(TANGENTIAL, "force")
    panel = Panel([Curve(moved, force, look=look), *ends], *labels)
    return Picture([panel], f"Tangential force, {name}", "best", (5.2, 4.2))


def path_picture(runs: Sequence[RunData], cases: Sequence[Case], kind: str, choice: Choice) -> Picture:
    """Pressures, forces, peak pressures, or else tangential forces over slip, of one run or several."""
    units, names = cases[0].units, run_names(runs) if len(runs) > 1 else [""]
    curves = []
    for run, name in zip(runs, names, strict=True):
        position = run.path.position
        # Exact contact is solved at a few positions: what lies between them is not on a straight line.
        joined = not run.contacts or bool(run.path.order.any())
        if not run.contacts and kind == "force":
            for load, force in run.path.resultants.items():
                curves.append(Curve(position, np.hypot(*force.T), f"{name}, {load}" if name else load))
        for own, contact in run.contacts.items():
            if choice.contact not in (None, own):
                continue
            single = name and (len(run.contacts) == 1 or choice.contact)
            label = name if single else ", ".join(filter(None, (name, own)))
            if kind == "pressure":
                for level in choice.at or (float(position[-1]),):
                    pressure = pressures_at(run, level)[own]
                    order, arc = along_surface(contact, pressure)
                    at = f"{label}, position {level:.4g}" if choice.at else label
                    curves.append(Curve(arc, pressure[order], at))
            elif kind == "force":
                curves.append(Curve(position, np.hypot(*contact_force(run, own).T), label, joined=joined))
            elif kind == "peak":
                highest = contact.pressure.max(axis=1, initial=0.0)
                curves.append(Curve(position, highest, label, joined=joined))
            elif not np.isnan(contact.slip).any() and (force := tangential_force(run, own)).any():
                curves.append(Curve(contact.slip @ contact.weight / contact.weight.sum(), force, label))
    if not curves:
        hint = "pressures and peaks need a contact, loops need friction"
        raise RunError(f"the runs have no data for {kind}", hint)
    which = "contact force" if any(run.contacts for run in runs) else "force of loads and supports"
    peak, pressed = "peak contact pressure", units.label("contact pressure", "stress")
    x_label, y_label, title = {
        "pressure": (units.label("arc length", "length"), pressed, "Contact pressure"),
        "force": (POSITION, units.label(f"{which} per unit thickness", "force"), which.capitalize()),
        "peak": (POSITION, units.label(peak, "stress"), peak.capitalize()),
    }.get(kind, (units.label(SLIP_LABEL, "length"), units.label(TANGENTIAL, "force"), "Tangential force"))
    alone = f", {curves[0].label}" if len(curves) == 1 else ""
    return Picture([Panel(curves, x_label, y_label)], title + alone, "best" if len(curves) > 1 else "")


def run_names(runs: Sequence[RunData]) -> list[str]:
    """Names of runs: the last parts of their directories, as many as needed to distinguish them."""
    parts = [run.directory.resolve().parts for run in runs]
    for count in range(1, max(map(len, parts)) + 1):
        names = ["/".join(part[-count:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{run.directory} ({number})" for number, run in enumerate(runs, start=1)]
