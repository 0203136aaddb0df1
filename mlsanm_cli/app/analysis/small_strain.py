"""The analysis at small strain: bodies condensed once to the unknowns of their contacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from mlsanm_cli.app.analysis import small_contacts
from mlsanm_cli.app.checks import end, states
from mlsanm_cli.app.checks.accuracy import Accuracy, with_friction
from mlsanm_cli.app.checks.check import Check, Verdicts, all_of, level, summary_limits
from mlsanm_cli.app.checks.end import End
from mlsanm_cli.app.checks.energy import (
    EnergyErrors,
    energy_error,
    flow_figures,
    force_balance,
    force_mismatch,
    worst_of,
)
from mlsanm_cli.app.checks.overlaps import overlaps
from mlsanm_cli.app.checks.peaks import boundary_peaks
from mlsanm_cli.app.checks.quality import MODEL, announce, assess
from mlsanm_cli.app.checks.refinement import set_up
from mlsanm_cli.app.output.analysis import Analysis, BodyFields
from mlsanm_cli.app.output.parts import ContactNodes, obstacle_shift, obstacles
from mlsanm_cli.app.scene.assemble import NOTHING
from mlsanm_cli.app.scene.build import Refinement
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.laws.contact_state import SlidingError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io.run_file import Attribute, Value
from mlsanm_cli.io.schema import Quantities, place
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.memo import digest
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.contact_states import at_limit
from mlsanm_cli.solve.fields import (
    fields_of,
    named_fields,
    platen_displacements,
    plates_turned,
    quantities,
    slave_arc,
)
from mlsanm_cli.solve.paths import load_path
from mlsanm_cli.solve.state import Checkpoint, Fields, PathStep, State

FAILING = ("linear_residual", "force_balance", "force_mismatch", "energy_error")
"""Checks at which a run fails whose levels are in the summary."""
FLOW_FIELDS = ("plastic_strain", "flow_stress", "yield_ratio")
"""Fields of bodies that flow; of elastic bodies in the same scene 0, nan and nan."""
WITH_STRESS = {"stress", "von_mises", "strain", *FLOW_FIELDS}
"""Fields that need stresses."""


class SmallStrain(Analysis[CondensedScene]):
    """The analysis at small strain; the clouds may be those of a ``refinement`` of an earlier process."""

    _accuracy: Accuracy
    _refinement = Refinement()
    _first: State | None = None
    _last: tuple[State, CondensedScene] | None = None
    _stressed: tuple[State, Mapping[str, Fields]] | None = None
    _energies: EnergyErrors | None = None
    _peaks: Mapping[str, Mapping[str, Any]] = NOTHING

    def _at(self, state: State) -> CondensedScene:
        """The scene with the plastic strains of a state."""
        if self._last is None or self._last[0] is not state:
            self._last = state, self.built.at(state)
        return self._last[1]

    def set_up(self, verdicts: Verdicts) -> None:
        self.quality = announce(self.case, self.prepared, self.context, verdicts)
        adapted = set_up(self.case, self.prepared, self.context, verdicts, self.known)
        self.prepared, self._built, self._accuracy, self._refinement = adapted
        if self.refinement:
            self.quality = assess(self.case, self.prepared, self.context.memo)
            verdicts.judge(all_of(MODEL, self.quality))

    def steps(self, start: Checkpoint | None, last: State | None, verdicts: Verdicts) -> Iterator[PathStep]:
        built = self.built
        steps = self.stopped(start, last, FINE_ROUND_OFF)
        while True:
            try:
                step = next(steps, None)
                for state in (*step.saved, step.state) if step is not None else ():
                    # A body that loads rotate without resistance; others are judged at the end of the path.
                    turned = states.body_rotation(self._at(state), state)
                    verdicts.judge(check for check in turned if check.outcome == "failed")
            except NumericalError as error:
                if last is not None and isinstance(error, SlidingError):
                    verdicts.judge(end.limit_load(built, last))
                position = 0.0 if last is None else last.position
                raise at_limit(built.scene, built.condensed, built.stages, position, error) from error
            if step is None:
                return
            last = step.state
            self._first = self._first or last
            yield step

    def checks(self, state: State) -> Iterator[Check]:
        return all_of(states.STATE, self._at(state), state)

    def path(self, start: Checkpoint | None = None, at: tuple[float, ...] = ()) -> Iterator[PathStep]:
        built, output = self.built, self.case.output
        if at:
            output = output.model_copy(update={"at": tuple(sorted({*built.outputs, *at}))})
            built = replace(built, case=built.case.model_copy(update={"output": output}))
        return load_path(built, start)

    def displacement(self, state: State) -> FloatArray:
        condensed, scene = self.built.condensed, self.built.scene
        return np.concatenate([condensed.displacement(scene, name, state.unknowns) for name in scene.bodies])

    def forces(self, state: State) -> Mapping[str, FloatArray]:
        condensed = self._at(state).condensed
        maps = {**condensed.quantities["contact"], **condensed.quantities["force"]}
        return {name: force(*state.unknowns) for name, force in maps.items()}

    def judge(self, last: State, tally: dict[str, Any]) -> Iterator[Check]:
        built, context = self._at(last), self.context
        if "linear_residual" not in tally:
            with context.phase("output"):
                unsaved, tally["linear_residual"] = fields_of(built, [last], False)[0]
            # At the nodes, as no state was saved.
            yield from overlaps(built, last, self.nodes, displacements(unsaved))
        with context.phase("output"):
            if self._stressed is not None and self._stressed[0] is last:
                fields = self._stressed[1]
            else:
                fields = fields_of(built, [last], stress=True)[0][0]
            self._energies = energy_error(built, last, fields)
            self._peaks = boundary_peaks(built, last, fields)
        figures = tally["linear_residual"], self._energies, self._peaks
        yield from all_of(end.END, End(built, self._first, last, *figures))
        if note := end.idle_note(built, last):
            context.console.note(note)
        self._accuracy = self._estimated(last)
        yield from end.estimates(built, self._accuracy.figures(built, last), self._accuracy.missing)

    def _estimated(self, last: State) -> Accuracy:
        accuracy, built = self._accuracy, self._at(last)
        if any(last.history(name)[:, 4].any() for name in built.laws):
            # By the spacings on the path, over the displacements of the bodies that flow.
            squares = 0.0
            for name in built.laws:
                moved = built.condensed.displacement(built.scene, name, last.unknowns)
                squares += float(built.scene.bodies[name].model.cloud.areas @ (moved**2).sum(axis=1))
            error = float(last.solver["errors"][1] / np.sqrt(squares)) if squares else 0.0
            unknown = {one.name: (np.nan, np.nan) for one in built.condensed.pairings}
            return Accuracy(error, unknown, accuracy.state)
        if len(self.built.condensed.friction_nodes):
            with self.context.phase("estimate"):
                accuracy = with_friction(self.built, accuracy, last, self.context.memo)
        if accuracy.displacement is None or self._energies is None:
            return accuracy
        # With the errors of displacements known from energies.
        deflection = self._energies.deflection
        displacement = float(np.hypot(accuracy.displacement, deflection))
        return replace(accuracy, displacement=displacement, deflection=deflection)

    @property
    def refinement(self) -> Mapping[str, Any]:
        return self._refinement.plain if len(self._refinement.passes) > 1 else {}

    @property
    def models(self) -> Mapping[str, BodyModel]:
        if self._built is None:
            return super().models
        return {name: body.model for name, body in self.built.scene.bodies.items()}

    @cached_property
    def _views(self) -> Mapping[str, small_contacts.View]:
        return small_contacts.finer_views(self.built, self.prepared.boundaries, self.context.memo)

    @property
    def clouds(self) -> Mapping[str, Cloud]:
        return {**self.nodes, **{name: view.cloud for name, view in self._views.items()}}

    @cached_property
    def contacts(self) -> Mapping[str, ContactNodes]:
        contacts = {}
        for pairing in self.built.condensed.reported:
            chosen = pairing.candidate
            places = pairing.points[chosen], pairing.normal[chosen], slave_arc(pairing)
            contacts[pairing.name] = ContactNodes(*places, pairing.areas[chosen])
        return contacts

    def model(self) -> tuple[dict[str, Value], Mapping[str, Attribute]]:
        datasets, condensed = super().model()[0], self.built.condensed
        for name, own in condensed.bonds.spans.items():
            both = [part[own] for part in np.split(condensed.bonds.tractions.matrix, 2)]
            datasets[place("maps", "bonds", name)] = np.concatenate(both)
        maps = (condensed.gap, condensed.slip, condensed.watched, condensed.balance)
        nodes = sum(len(cloud.points) for cloud in self.nodes.values())
        return datasets, {"cache_hash": digest(maps, condensed.weight), "nodes": str(nodes)}

    def series_maps(self) -> dict[str, Value]:
        condensed, known = self.built.condensed, self.built.condensed.quantities
        slips = {name: condensed.slip.take(own) for name, own in condensed.tangential.items()}
        maps = {"forces": known["force"], "slip": slips, "probes": known["probe"]}
        return {
            place("maps", kind, name): one.matrix for kind, own in maps.items() for name, one in own.items()
        }

    def quantities(self, state: State) -> Quantities:
        return quantities(self._at(state), state)

    def fields(self, states: Sequence[State]) -> Iterator[tuple[BodyFields, Mapping[str, float]]]:
        stress = bool(WITH_STRESS & set(self.fields_written))
        alike = [states] if not self.built.laws else [[state] for state in states]
        known = [one for few in alike if few for one in fields_of(self._at(few[0]), few, stress)]
        for state, (fields, residual) in zip(states, known, strict=True):
            if stress:
                self._stressed = state, fields
            built, shown = self._at(state), dict(fields)
            for name, view in self._views.items():
                points = view.cloud.points
                moved, stressed = built.condensed.contact_fields(built.scene, name, state.unknowns, points)
                seen = (view.rows @ fields[name]["rest"].ravel()).reshape(-1, len(points)).T
                sigma = seen[:, 2:] + stressed if stress else stressed[:0]
                places = points, view.values
                shown[name] = named_fields(built, name, state, seen[:, :2] + moved, sigma, *places)
            yield shown, {"linear_residual": residual}

    @property
    def fields_written(self) -> Sequence[str]:
        """Those of the case, and of scenes with a yield stress what tells how far bodies flow."""
        flow = FLOW_FIELDS if self._built is not None and self._built.laws else ()
        return (*super().fields_written, *flow)

    def field_checks(self, state: State, fields: BodyFields) -> Iterator[Check]:
        moved = displacements(fields)
        yield from overlaps(self._at(state), state, self.clouds, moved)
        yield from small_contacts.sliding_distance(self._at(state), state, self.clouds, moved)

    def lines(self, state: State, fields: BodyFields) -> tuple[Mapping[str, VtuPart], Mapping[str, VtuPart]]:
        built = self._at(state)
        moved = platen_displacements(built, state)
        lines = {
            name: VtuPart(*part, {"displacement": obstacle_shift(self.case, name, moved) + 0.0 * part[0]})
            for name, part in obstacles(self.case, self.points).items()
        }
        return small_contacts.contact_lines(built, state, self.clouds, fields), lines

    def tallied(self, tally: Mapping[str, Any], before: State | None, step: PathStep) -> dict[str, Any]:
        # The largest |t| / (mu p) of the closed nodes of every contact with friction.
        cone, condensed = dict(tally.get("cone", {})), self.built.condensed
        for name, own in condensed.tangential.items():
            for state in (step.state, *step.saved):
                pressure = state.pressure[condensed.spans[name]]
                pressed = pressure > ROUND_OFF * pressure.max(initial=0.0)
                pressed &= state.closed[condensed.spans[name]]
                limit = condensed.friction[own] * pressure
                ratio = np.abs(state.traction[own][pressed]) / limit[pressed]
                cone[name] = max(cone.get(name, 0.0), float(ratio.max(initial=0.0)))
        return {"cone": cone}

    def progress(self, step: PathStep) -> list[str]:
        closed, pressure = step.state.closed, step.state.pressure
        return [f"closed {int(closed.sum())}", f"peak pressure {pressure.max():.6g}"] if len(pressure) else []

    def diagnosis(self, state: State | None) -> tuple[Sequence[VtuPart], Mapping[str, Any]]:
        if self._built is None or state is None:
            return super().diagnosis(state)
        return small_contacts.worst_state(self._at(state), state, self.nodes)

    @property
    def notes(self) -> Iterator[str]:
        # Bodies whose factorisation had to use a slower method.
        for name, body in self.built.scene.bodies.items() if self._built else ():
            if body.equations.note:
                yield f"body {name}: {body.equations.note}"

    def sizes(self, tally: Mapping[str, Any]) -> dict[str, Any]:
        sizes = super().sizes(tally)
        sizes |= {"linear_residual": tally.get("linear_residual"), "stability": None}
        if self._built is None:
            return sizes
        built, bodies = self.built, self.built.scene.bodies.values()
        mirrors = [body.model.cloud.mirror for body in bodies]
        lines = {None if mirror is None else str(mirror.line) for mirror in mirrors}
        sizes |= {"adapt": self._refinement.passes} if self.refinement else {}
        return sizes | {
            # The symmetry line of the nodes of all bodies.
            "symmetry": lines.pop() if len(lines) == 1 else None,
            "contact_unknowns": len(built.condensed.weight) + len(built.condensed.friction_nodes),
            "elastic_factorizations": len({id(body.system) for body in bodies}),
            "condensation_solves": built.condensed.solves,
            "enlarged_stencils": sum(body.model.stencils.enlarged for body in bodies),
            "stability": built.stability,
        }

    def figures(self, state: State, tally: Mapping[str, Any]) -> dict[str, Any]:
        built = self._at(state)
        imbalance, lost, cone = force_balance(built, state), force_mismatch(built, state), tally["cone"]
        energies = dict(self._energies.bodies) if self._energies else {}
        contacts = {
            one.name: small_contacts.contact_summary(built, one, state)
            | {"max_cone_ratio": cone.get(one.name), "force_mismatch": lost.get(one.name)}
            for one in built.condensed.reported
        }
        plates = {"plates": plates_turned(built, state)} if built.condensed.quantities["moment"] else {}
        figures: dict[str, Any] = plates | flow_figures(built, state)
        return figures | {
            "contacts": contacts,
            "error_estimate": self._accuracy.figures(built, state),
            "peak_stress": dict(self._peaks),
            "force_balance": imbalance[worst_of(imbalance)],
            "force_balance_bodies": imbalance,
            "energy_error": energies[worst_of(energies)] if energies else None,
            "energy_error_bodies": energies,
        }

    def limits(self) -> dict[str, Any]:
        asked = self.case.solver.tolerance, FAILING, "rough_pressure_error"
        if self._built is None:
            return summary_limits(*asked, {})
        displacement, condensed = level("displacement_error"), self._built.condensed
        estimates = {
            "displacement": displacement,
            "pressure": {one.name: level(end.pressure_limit(one)) for one in condensed.pairings},
            "force": {one.name: level("force_error") for one in condensed.pairings},
            "probes": dict.fromkeys(condensed.quantities["probe"], displacement),
        }
        return summary_limits(*asked, estimates) | {"stability": self._built.stability_limit}


def displacements(fields: Mapping[str, Fields]) -> dict[str, FloatArray]:
    """The displacements (n, 2) among the fields of all bodies."""
    return {name: values["displacement"] for name, values in fields.items()}
