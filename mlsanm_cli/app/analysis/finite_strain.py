"""The analysis at finite strain: equations renewed as bodies deform, exact contact with Coulomb friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.check import Check, Verdicts, all_of, level, summary_limits
from mlsanm_cli.app.checks.quality import announce
from mlsanm_cli.app.finite import accuracy, fields
from mlsanm_cli.app.finite.checks import END, STATE, FiniteEnd
from mlsanm_cli.app.finite.contact_path import contact_path
from mlsanm_cli.app.finite.grids import located, with_knots
from mlsanm_cli.app.finite.path import finite_path
from mlsanm_cli.app.finite.scene import FiniteScene, finite_scene
from mlsanm_cli.app.output.analysis import Analysis, BodyFields
from mlsanm_cli.app.output.parts import ContactNodes, contact_part, obstacles, vtu_states
from mlsanm_cli.app.scene.build import Refinement
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.pair import RigidContact
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io.schema import Quantities
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.state import Bifurcation, Checkpoint, PathStep, State


def contact_lines(scene: FiniteScene, state: State) -> dict[str, VtuPart]:
    """Slave sides of all contacts in a state with their pressures; stresses act on the slave of the case."""
    records, lines = fields.contact_values(scene, state), {}
    for contact, _, there in scene.contacts.each:
        record, side = records[contact.name], contact.slave
        moved = state.solver["surface"][there][: 2 * side.count].reshape(-1, 2)
        sign, deformed = -1.0 if contact.exchanged else 1.0, side.deformed(moved.ravel())[0]
        stretch = np.abs(deformed)
        normal = -sign * as_real(as_complex(side.outward) * deformed / stretch)
        stress = sign * state.side_traction[there].reshape(-1, 2)[: side.count] / stretch[:, None]
        numbers = np.arange(side.count, dtype=np.int64)
        edges = np.stack([numbers, np.roll(numbers, -1)], axis=1)[: None if side.around is not None else -1]
        lines[contact.name] = contact_part(
            *(side.places, edges, record, bool(contact.friction)),
            arc_length=side.arc,
            displacement=moved,
            normal=normal,
            contact_stress=stress,
        )
    return lines


class FiniteStrain(Analysis[FiniteScene]):
    """The analysis at finite strain, with the knots of a ``refinement`` if these are known."""

    _missed: Callable[[], Any] | None = None
    _estimates: tuple[State, dict[str, Any]] | None = None

    def set_up(self, verdicts: Verdicts) -> None:
        self.quality = announce(self.case, self.prepared, self.context, verdicts)
        with self.context.phase("operators"):
            scene = finite_scene(self.case, self.prepared)
        if self.known is not None and self.known.knots:
            scene = with_knots(scene, self.known.knots)
        elif scene.contacts.pairs:
            with self.context.phase("condensation", "locating contacts"):
                scene = located(scene, self.context)
        self._built = scene

    def steps(self, start: Checkpoint | None, last: State | None, verdicts: Verdicts) -> Iterator[PathStep]:
        for step in self.stopped(start, last, self.case.solver.tolerance):
            self._missed = step.missed
            yield step

    def path(self, start: Checkpoint | None = None, at: tuple[float, ...] = ()) -> Iterator[PathStep]:
        if self.built.in_increments:
            return contact_path(self.built, start, at)
        return finite_path(self.built, start, at=at)

    def displacement(self, state: State) -> FloatArray:
        return state.displacement.reshape(-1, 2)

    def forces(self, state: State) -> Mapping[str, FloatArray]:
        forces = fields.resultants(self.built, state)
        return forces | {name.removeprefix(fields.CONTACT_PREFIX): force for name, force in forces.items()}

    def checks(self, state: State) -> Iterator[Check]:
        return all_of(STATE, self.built, state)

    def judge(self, last: State, tally: dict[str, Any]) -> Iterator[Check]:
        return all_of(END, FiniteEnd(self.built, last, tally, self._errors(last, tally)))

    @property
    def refinement(self) -> Mapping[str, Any]:
        pairs = () if self._built is None else self._built.contacts.pairs
        knots = [[side.arc for side in contact.sides] for contact in pairs]
        return Refinement(knots=knots).plain if self._built is not None else {}

    @cached_property
    def contacts(self) -> Mapping[str, ContactNodes]:
        contacts, met = {}, self.built.undeformed_contacts
        for contact, here, _ in self.built.contacts.each:
            slave, sign = contact.slave, -1.0 if contact.exchanged else 1.0
            normal = sign * met.normal[here]
            contacts[contact.name] = ContactNodes(slave.places, normal, slave.arc, slave.weight)
        return contacts

    def quantities(self, state: State) -> Quantities:
        return fields.quantities(self.built, state)

    def row_states(self, step: PathStep) -> Sequence[State]:
        return (*(state for state in step.saved if state is not step.state), step.state)

    @property
    def fields_written(self) -> Sequence[str]:
        names = super().fields_written
        return (*names, "stretch", "volume_ratio") if "stress" in names else names

    def fields(self, states: Sequence[State]) -> Iterator[tuple[BodyFields, Mapping[str, float]]]:
        for state in states:
            yield fields.fields_of(self.built, state), {}

    def lines(self, state: State, fields: BodyFields) -> tuple[Mapping[str, VtuPart], Mapping[str, VtuPart]]:
        drawn, lines = obstacles(self.case, self.points), {}
        for contact in self.built.contacts.pairs:
            if isinstance(contact, RigidContact):
                places, edges = drawn[contact.name]
                turned = (places - contact.pivot) @ contact.turn(state.driven).T
                moved = contact.pivot + contact.motion @ state.driven + turned - places
                lines[contact.name] = VtuPart(places, edges, {"displacement": moved})
        return contact_lines(self.built, state), lines

    def tallied(self, tally: Mapping[str, Any], before: State | None, step: PathStep) -> dict[str, Any]:
        scene, state = self.built, step.state
        bodies, (nodal, energy) = fields.body_forces(scene, state), accuracy.energy_errors(scene, state)
        error = sum(float(each.sum()) for each in nodal.values())
        largest = max(tally.get("largest", 0.0), *(one.size for one in bodies.values()))
        # Rigid motion leaves round-off in the forces.
        stiffest = max(body.elastic.model.material.modulus for body in scene.bodies.values())
        tiny = ROUND_OFF * stiffest * float(np.abs(state.displacement).max())
        missing = dict(tally.get("missing", {}))
        for ends in pairwise((before, *step.way, state)) if before is not None else ():
            for name, work in accuracy.missing_works(scene, *ends).items():
                missing[name] = missing.get(name, 0.0) + work
        stability = float(state.solver.get("stability", np.inf))
        return {
            "renewed": tally.get("renewed", 0) + step.renewed,
            "limit_points": [*tally.get("limit_points", ()), *step.limit_points],
            "bifurcations": [*tally.get("bifurcations", ()), *map(self._fork, step.bifurcations)],
            "stability": min(tally.get("stability", np.inf), stability),
            "largest": largest,
            "balance": max(one.rest for one in bodies.values()) / max(largest, tiny) if largest else 0.0,
            "kept": max(tally.get("kept", 0.0), abs(step.kept)),
            "unaccounted": max(tally.get("unaccounted", 0.0), error + abs(step.kept)),
            "energy": max(tally.get("energy", 0.0), energy),
            "missing": missing,
        }

    def _fork(self, at: Bifurcation) -> dict[str, Any]:
        """A bifurcation in plain values, with the node that moves most."""
        motions = {name: own.reshape(-1, 2) for name, own in self.built.parts(at.motion).items() if own.any()}
        sizes = {name: np.hypot(*own.T) for name, own in motions.items()}
        body = max(sizes, key=lambda name: float(sizes[name].max()))
        node = int(np.argmax(sizes[body]))
        return {
            "position": at.position,
            "body": body,
            "point": self.nodes[body].points[node].tolist(),
            "direction": (motions[body][node] / sizes[body][node]).tolist(),
            "followed": at.followed,
            "decided": at.decided,
        }

    def progress(self, step: PathStep) -> list[str]:
        points = [f"limit point {position:.6g}" for position, _ in step.limit_points]
        points += [f"bifurcation {one.position:.6g}" for one in step.bifurcations]
        return [*points, "equations renewed"] if step.renewed else points

    def diagnosis(self, state: State | None) -> tuple[Sequence[VtuPart], Mapping[str, Any]]:
        if self._built is None or state is None:
            return super().diagnosis(state)
        parts = vtu_states(self.clouds, fields.fields_of(self.built, state), self.fields_written)
        return list(parts.values()), {}

    def figures(self, state: State, tally: Mapping[str, Any]) -> dict[str, Any]:
        scene = self.built
        turned, stability = fields.plates_turned(scene, state), tally["stability"]
        return {
            "contact_unknowns": len(state.pressure),
            "contacts": fields.figures_of_contacts(scene, state),
            **({"plates": turned} if turned else {}),
            "force_balance": tally["balance"],
            **({"stability": stability} if np.isfinite(stability) else {}),
            "error_estimate": self._errors(state, tally),
            "energy_error": accuracy.work_error(tally),
            "finite_strain": {
                "law": ", ".join(dict.fromkeys(body.law.name for body in scene.bodies.values())),
                **fields.extremes(scene, state),
                "equations_renewed": tally["renewed"],
                "limit_points": [
                    {"position": position, "kind": "maximum" if highest else "minimum"}
                    for position, highest in tally["limit_points"]
                ],
                "bifurcations": tally["bifurcations"],
            },
        }

    def _errors(self, last: State, tally: Mapping[str, Any]) -> dict[str, Any]:
        """Estimated errors of the last state; of displacements None if clouds are too small for one."""
        if self._estimates is not None and self._estimates[0] is last:
            return self._estimates[1]
        missing: dict[str, Any] = {"displacement": None}
        if self._missed is not None:
            with self.context.phase("estimate"), suppress(NumericalError, np.linalg.LinAlgError):
                missing = accuracy.missing_figures(self.built, last, self._missed())
        # Of the energy the largest one on the path, over the largest energy.
        errors = {"energy": tally["unaccounted"] / tally["energy"] if tally["energy"] else 0.0} | missing
        if any(one.friction for one in self.built.contacts.pairs):
            errors["increments"] = float(last.solver["increment_error"])
        self._estimates = last, errors
        return errors

    def limits(self) -> dict[str, Any]:
        names = [] if self._built is None else [one.name for one in self._built.contacts.pairs]
        estimates = {
            "energy": level("energy_estimate"),
            "displacement": level("displacement_error"),
            "pressure": dict.fromkeys(names, level("rough_pressure_error")),
            "contacts": dict.fromkeys(names, level("finite_force_error")),
        }
        fails = ("force_balance", "ellipticity", *(("stability",) if names else ()))
        return summary_limits(self.case.solver.tolerance, fails, "energy_estimate", estimates)
