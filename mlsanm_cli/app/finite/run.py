"""``mlsanm run`` of a case at finite strain, and warnings of its last state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.energy import NODE_FORCE_SHIFT
from mlsanm_cli.app.checks.quality import Quality, announce
from mlsanm_cli.app.checks.verdicts import BALANCE_LIMIT, ENERGY_WARNING
from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.finite.contact_path import contact_path
from mlsanm_cli.app.finite.estimate import ESTIMATE_WARNING, EnergyError, check_work, missing_figures
from mlsanm_cli.app.finite.fields import (
    SceneForces,
    contact_summary,
    extremes,
    plates_turned,
    probe_records,
    resultants,
)
from mlsanm_cli.app.finite.patches import between_nodes
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.recorder import FiniteRecorder
from mlsanm_cli.app.finite.refinement import Refinement, contact_errors, is_automatic, refined
from mlsanm_cli.app.finite.scene import FiniteScene, finite_scene
from mlsanm_cli.app.finite.verdict import ELLIPTICITY_WARNING
from mlsanm_cli.app.output.checkpoint import interrupted_run
from mlsanm_cli.app.output.summary import Ending, head, probe_figures, tail
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import LoadedCase, finer_nodes
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_reader import RunOrigin
from mlsanm_cli.solve.coercivity import CONTACT_LIMIT
from mlsanm_cli.solve.state import State


def run_finite(
    loaded: LoadedCase,
    prepared: SceneModel,
    directory: Path,
    provenance: Mapping[str, str | int | float],
    context: RunContext,
    origin: RunOrigin | None = None,
) -> Mapping[str, Any]:
    """Follow the path and write the run directory, or continue the run ``origin``; returns the content of
    summary.json."""
    case, earlier = loaded.case, interrupted_run(origin) if origin is not None else None
    refinement = Refinement.read(earlier.figures) if earlier else Refinement()
    if len(refinement.zones):
        prepared = place(case, context, refinement.asked)
    while True:
        with context.phase("operators"):
            scene = finite_scene(case, prepared)
        with FiniteRecorder(directory, loaded, provenance, context, refinement, earlier) as recorder:
            quality = announce(case, prepared, context, recorder.warn)
            failure, stop = _followed(scene, recorder, context)
            finer = None
            if stop is None:
                finer = refined(scene, recorder.touched, refinement, failure, context)
            if finer is None:
                errors = _errors(scene, recorder, context.clock)
                ending = _ending(scene, recorder, context, errors, failure, stop)
                summary = _summary(scene, recorder, ending, quality, context.clock, errors)
                recorder.finish(summary)
                return summary
        refinement, prepared = finer
        earlier = None
        run_dir.prepare(directory, force=True)
        context.console.note("repeating the run with finer nodes in contact")


def _followed(
    scene: FiniteScene, recorder: FiniteRecorder, context: RunContext
) -> tuple[NumericalError | None, KeyboardInterrupt | None]:
    """Follow the path; returns the error or the interrupt that ended it, if any."""
    try:
        checkpoint = recorder.start(scene)
        context.stop_gently()
        steps = contact_path(scene, checkpoint) if scene.in_increments else finite_path(scene, checkpoint)
        while True:
            context.check_stop()
            with context.phase("continuation"):
                step = next(steps, None)
            if step is None:
                return None, None
            recorder.step(scene, step)
    except NumericalError as error:
        return error, None
    except KeyboardInterrupt as stop:
        return None, stop


def _ending(
    scene: FiniteScene,
    recorder: FiniteRecorder,
    context: RunContext,
    errors: Mapping[str, Any],
    failure: NumericalError | None,
    stop: KeyboardInterrupt | None,
) -> Ending:
    """The end of the path."""
    if stop is not None:
        ending = Ending("stopped", str(stop), f"continue with: {run_dir.resume_command(recorder.directory)}")
        context.console.note(ending.hint)
        return ending
    try:
        if failure is not None:
            raise failure
        _check_end(scene, recorder, errors)
    except NumericalError as error:
        context.console.warning(error.advice)
        recorder.failure(error, scene)
        return Ending("failed", error.message, error.hint)
    return Ending("done", "end of the last stage")


def _errors(scene: FiniteScene, recorder: FiniteRecorder, clock: Clock) -> dict[str, Any]:
    """Estimated errors of the last state; of displacements None where the clouds are too small for one."""
    missing: dict[str, Any] = {"displacement": None}
    if recorder.missed is not None and recorder.last is not None:
        with clock.phase("estimate"), suppress(NumericalError, np.linalg.LinAlgError):
            missing = missing_figures(scene, recorder.last, recorder.missed())
    found, forces = {"energy": recorder.estimate} | missing, missing.get("contacts", {})
    for name, error in contact_errors(recorder.refinement, recorder.touched).items():
        forces[name] = max(error, forces.get(name, 0.0))
    return found | ({"contacts": forces} if forces else {})


def _check_end(scene: FiniteScene, recorder: FiniteRecorder, errors: Mapping[str, Any]) -> None:
    """Warn of an inaccurate last state. NumericalError if its forces are not balanced."""
    assert recorder.last is not None
    waves = extremes(scene, recorder.last)["ellipticity"]
    if waves < ELLIPTICITY_WARNING:
        recorder.warn(
            f"the law is close to losing ellipticity: acoustic tensor {waves:.2g} of the shear modulus"
        )
    if recorder.estimate > ESTIMATE_WARNING:
        kept = recorder.kept / recorder.energy
        recorder.warn(EnergyError.of(scene, recorder.last).warning(scene, recorder.estimate, kept))
    if text := check_work(scene, recorder.missing, recorder.energy_error):
        recorder.warn(text)
    for name, error in errors.get("contacts", {}).items():
        if error > ESTIMATE_WARNING:
            sides = next(one for one in scene.contacts.pairs if one.name == name).sides
            size = f"the force is estimated to be off by {100.0 * error:.2g} %"
            hint = finer_nodes(scene.case, [side.body for side in sides])
            recorder.warn(f"contact {name}: {size}; {hint}")
    for text in recorder.refinement.warnings:
        recorder.warn(text)
    for text in few_nodes(scene, recorder.last):
        recorder.warn(text)
    for text in held_at_points(scene, recorder.last):
        recorder.warn(text)
    # Reactions at single nodes are not known from the stress.
    single = any(body.elastic.held_nodes for body in scene.bodies.values())
    if recorder.balance > BALANCE_LIMIT and not single:
        raise NumericalError(
            f"force imbalance on a body: {100 * recorder.balance:.2g} % of the largest force",
            "make the spacing smaller",
        )


def _summary(
    scene: FiniteScene,
    recorder: FiniteRecorder,
    ending: Ending,
    quality: Quality,
    clock: Clock,
    errors: Mapping[str, Any],
) -> dict[str, Any]:
    """Content of summary.json for the completed part of the path."""
    state, nodes = recorder.last, scene.unknowns // 2
    summary = head(ending, recorder, recorder.steps, state.position if state else None)
    if ending.hint:
        summary["hint"] = ending.hint
    summary |= {"nodes": nodes, "unknowns": 2 * nodes, "contact_unknowns": 0, "contacts": {}}
    summary |= {"residual": recorder.residual}
    if state is not None:
        forces = SceneForces.of(scene, state)
        summary["contact_unknowns"] = len(state.pressure)
        summary["contacts"] = contact_summary(scene, state, forces)
        summary["forces"] = {name: force.tolist() for name, force in resultants(scene, forces).items()}
        if scene.probes:
            summary["probes"] = {
                name: probe_figures(seen) for name, seen in probe_records(scene, state).items()
            }
        if turned := plates_turned(scene, state):
            summary["plates"] = turned
        summary["force_balance"] = recorder.balance
        if np.isfinite(recorder.stability):
            summary["stability"] = recorder.stability
        summary["error_estimate"] = errors
        summary["energy_error"] = recorder.energy_error
        summary["finite_strain"] = {
            "law": ", ".join(dict.fromkeys(body.law.kind for body in scene.bodies.values())),
            **extremes(scene, state),
            "equations_renewed": recorder.renewed,
            "limit_points": [
                {"position": position, "kind": "maximum" if highest else "minimum"}
                for position, highest in recorder.turns
            ],
        }
    limits: dict[str, Any] = {
        "residual": scene.case.solver.tolerance,
        "force_balance": BALANCE_LIMIT,
        "ellipticity": 0.0,
        "error_estimate": ESTIMATE_WARNING,
        "estimates": {
            "energy": ESTIMATE_WARNING,
            "contacts": dict.fromkeys((one.name for one in scene.contacts.pairs), ESTIMATE_WARNING),
        },
    }
    if "stability" in summary:
        limits["stability"] = CONTACT_LIMIT
    return summary | tail(recorder, quality, limits, clock)


MIN_CONTACT_NODES, MIN_FREE_NODES = 4, 6
"""Number of nodes in a contact below which its pressures are not reliable; the second where it ends between
nodes: of two half-disks with 3 and 5 nodes in contact forces were 4.9 and 0.8 % off, peaks 12 and 2 %."""
MIN_LATERAL_SHARE = 1e-3
"""Lateral part of a force below which its direction is not reported."""
RESOLVED_NODES = 20
"""Number of nodes in a contact up to which half a spacing at its ends matters."""


def few_nodes(scene: FiniteScene, state: State) -> Iterator[str]:
    """Warnings of contacts with too few nodes, or that may touch between nodes."""
    for contact, here, _ in scene.contacts.each:
        side = contact.slave
        closed, gap = state.closed[here], state.gap[here]
        near = int(np.argmin(gap))
        spacing = float(side.weight[near])
        # A corner touches by one node, however fine nodes are.
        at_corners = np.isin(np.flatnonzero(closed), side.corners).all()
        coarser = "" if is_automatic(scene.case, contact) else ', or leave the spacing to "auto"'
        if not closed.any():
            if between_nodes(side, state, here):
                yield (
                    f"contact {contact.name}: no node of {side.name} is in contact, but it may touch between "
                    f"its nodes, {spacing:.3g} apart: use finer nodes there"
                )
        elif not at_corners and (closed.sum() < MIN_CONTACT_NODES or _few_to_free_ends(side, closed)):
            lean = _lean(side, closed, state.solver["normal"][here])
            leans = f", lateral error {100.0 * lean:.2g} %" if lean > MIN_LATERAL_SHARE else ""
            yield (
                f"contact {contact.name}: too few nodes of {side.name} in contact for accurate pressures "
                f"({closed.sum()}, {spacing:.3g} apart){leans}: use finer nodes there{coarser}"
            )
        elif isinstance(contact, BodyContact) and closed.sum() < RESOLVED_NODES:
            yield from _ends(contact, closed, state.solver["place"][here])


def _few_to_free_ends(side: ContactSide, closed: BoolArray) -> bool:
    """Whether some ``closed`` nodes (c,) are next to open ones of a smooth part of a side, and few nodes are
    closed, with their images behind planes of symmetry."""
    ends = np.flatnonzero(closed & ~(np.roll(closed, 1) & np.roll(closed, -1)))
    mirrored = any(axis is not None and closed[end] for end, axis in zip((0, -1), side.mirrors, strict=True))
    few = closed.sum() * (2 if mirrored else 1) < MIN_FREE_NODES
    return bool(few and not np.isin(ends, side.corners).all())


def _lean(side: ContactSide, closed: BoolArray, normal: FloatArray) -> float:
    """Possible lateral part of the force on few ``closed`` nodes (c,): its place is known to half of their
    distance, over which the ``normal`` (c, 2) turns."""
    numbers = np.flatnonzero(closed)
    beside = (numbers[:, None] + np.array([-1, 1])) % side.count
    turned = np.hypot(*(normal[beside] - normal[numbers, None]).T)
    if side.around is None:
        turned = turned[(np.abs(beside - numbers[:, None]) == 1).T]
    return float(0.5 * turned.max(initial=0.0) / len(numbers))


def _ends(contact: BodyContact, closed: BoolArray, place: FloatArray) -> Iterator[str]:
    """Warnings of ends of the master surface between nodes of the slave."""
    slave, master = contact.slave, contact.master
    if master.around is not None:
        return
    for number, end in ((0, master.arc[0]), (-1, master.arc[-1])):
        beside = np.flatnonzero(closed & (np.abs(place - end) < slave.weight))
        beside = beside[(beside > 0) & (beside < slave.count - 1)] if slave.around is None else beside
        free = beside[~closed[beside - 1] | ~closed[(beside + 1) % slave.count]]
        if len(free):
            x, y = master.places[number]
            yield (
                f"contact {contact.name}: the end of {master.name} at ({x:.6g}, {y:.6g}) presses "
                f"between nodes of {slave.name}, {slave.weight[free[0]]:.3g} apart: the position of "
                f"its force is uncertain by half of that; use finer nodes there"
            )


def held_at_points(scene: FiniteScene, state: State) -> Iterator[str]:
    """Warnings of bodies held at single nodes whose displacement depends on the spacing."""
    forces, parts = SceneForces.of(scene, state), scene.parts(state.displacement)
    for name, body in scene.bodies.items():
        nodes = body.elastic.held_nodes[: len(body.elastic.held_nodes) - body.pins]
        counts = np.array([sum(axis == one for _, one in nodes) for axis in (0, 1)])
        if not counts.any():
            continue
        cloud, own = body.elastic.model.cloud, parts[name]
        force = np.where(counts, forces.bodies[name].total / np.maximum(counts, 1), 0.0)
        soft = body.elastic.model.material.contact_compliance(np.eye(2))
        angle = body.turn(own)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        bent = cloud.points + own.reshape(-1, 2) - cloud.points @ turn.T
        bent = np.abs(bent - cloud.areas @ bent / cloud.areas.sum()).max()
        part = float((NODE_FORCE_SHIFT * soft * np.abs(force)).max() / bent) if bent else 0.0
        if part > ENERGY_WARNING:
            yield (
                f"body {name} is held at single nodes: displacements next to a point force are unbounded, "
                f"and grow by up to {100 * part:.2g} % of the deformation when body.{name}.spacing is "
                "halved; support a part of a boundary (from, to), or a small hole"
            )
