"""Checks of every state of a path at small strain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.checks.check import Check, level
from mlsanm_cli.contact.complementarity.equilibrium import undetermined
from mlsanm_cli.contact.complementarity.problem import GRAZING
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.contact_states import moving_bodies, reach_error
from mlsanm_cli.solve.direction_updates import turned_by_loads
from mlsanm_cli.solve.state import State


def solution(built: CondensedScene, state: State) -> Iterator[Check]:
    """The residual, numbers that are not finite, and tractions beyond the friction limit."""
    message = f"the residual {state.residual:.3g} at position {state.position:.6g} is above the tolerance"
    hint = "raise solver.tolerance only if that residual is small enough for your purpose"
    yield Check("residual", state.residual, message, hint, fails=built.case.solver.tolerance)
    message = f"the state at position {state.position:.6g} is not finite"
    yield Check("finite", float(not state.is_finite), message)
    condensed = built.condensed
    if not len(condensed.friction_nodes):
        return
    limit = condensed.friction * np.maximum(state.pressure[condensed.friction_nodes], 0.0)
    beyond = float((np.abs(state.traction) - limit).max())
    peak = max(float(end.pressure.max()) for end in built.ends)
    rough = [contact for contact in built.case.touching if contact.regularization.law != "exact"]
    smooth = max((contact.coefficient * contact.regularization.eta for contact in rough), default=0.0)
    share = max(beyond / peak, 0.0) if peak > 0.0 else beyond
    message = f"a traction is beyond the friction limit at position {state.position:.6g}"
    hint = 'lower solver.tolerance, or use contact.regularization.law = "exact"'
    yield Check("friction_limit", share, message, hint, fails=max(level("friction_limit"), smooth))


def contact_reach(built: CondensedScene, state: State) -> Iterator[Check]:
    """Nodes outside a contact that touch, and pressures at an end of a grid although the surface goes on."""
    reaches = {contact.name: contact.reach for contact in built.case.contact}
    touched, cut = built.condensed.touched(*state.unknowns), built.condensed.cut(state.pressure)
    at, where = f"at position {state.position:.3g}", "at the ends of the stages"
    known = f"add {state.position:.3g} to output.at: contacts are found there before the path begins"
    if built.laws:
        where = "in the states from which its grid was found"
        known = "quarter solver.max_increment: contacts are found along the path before it is followed"
    for pairing in built.condensed.pairings:
        name, gaps = pairing.name, pairing.gap[touched[pairing.name]]
        message, hint = "", ""
        if len(gaps) and reaches[name] == "auto" and gaps.max() >= 0.0:
            message = f"contact {name}: {at} the surfaces touch at a place that is open {where}"
            hint = known
        elif len(gaps):
            error = reach_error(name, float(gaps.max()))
            message, hint = error.message, error.hint
        elif name in cut:
            message, hint = f"contact {name}: {at} it is wider than its grid", known
        yield Check("contact_reach", len(gaps) + (name in cut), message, hint, f"contact {name}")


def body_rotation(built: CondensedScene, state: State) -> Iterator[Check]:
    """The body that would rotate much farther, or without resistance, by forces where they have moved to."""
    contacts = state.contacts(built.condensed.friction_nodes)
    turned = turned_by_loads(built.scene, built.condensed, contacts)
    if turned is not None and turned.error:
        # Where all nodes slip, as in a disk that settles in a groove, nothing resists a rotation further.
        contacts = replace(contacts, status=built.condensed.problem.touching(state.closed))
        turned = turned_by_loads(built.scene, built.condensed, contacts)
    if turned is not None and turned.error:
        yield Check("body_rotation", turned.share, turned.error.message, turned.hint, turned.names)
    elif turned is not None:
        message = (
            f"{turned.names} rotates by {np.degrees(turned.angle):.2g} degrees, and would rotate "
            f"{1.0 / (1.0 - turned.share):.3g} times as far with forces at their displaced positions"
        )
        yield Check("body_rotation", turned.share, message, turned.hint, turned.names)


def uniqueness(built: CondensedScene, state: State) -> Iterator[Check]:
    """Bodies that may move along contacts with friction without a change of any force."""
    condensed = built.condensed
    if built.case.is_regularized or not len(condensed.friction_nodes):
        return
    problem, nodes = condensed.problem, condensed.friction_nodes
    status = state.contacts(nodes).status
    x = np.concatenate([state.pressure, state.traction, state.motion]) / problem.columns
    acting = condensed.balance.load[:, state.factors != 0.0].T
    motion = undetermined(problem, status, x, acting * problem.columns[problem.contacts :])
    names = places = ""
    if motion is not None:
        names = " and ".join(moving_bodies(built.scene, motion)[0])
        slips = np.abs(condensed.slip.motion @ motion)
        least = GRAZING * slips.max()
        spans = condensed.tangential.items()
        places = " and ".join(name for name, span in spans if slips[span].max(initial=0.0) > least)
    message = (
        f"at position {state.position:.6g} the state is not unique: {names} may move along {places} "
        "without a change of any force, so that displacements and slips are one of several solutions"
    )
    hint = "give the contacts different coefficients of friction, or hold the body with a [[support]]"
    yield Check("uniqueness", float(motion is not None), message, hint)


STATE: Sequence[Callable[[CondensedScene, State], Iterator[Check]]] = (solution, contact_reach, uniqueness)
"""Checks of every state."""
