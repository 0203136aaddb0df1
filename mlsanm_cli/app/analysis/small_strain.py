"""The analysis at small strain: bodies condensed once to the unknowns of their contacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from mlsanm_cli.app.checks.diagnosis import diagnose, node_fields, worst_nodes
from mlsanm_cli.app.checks.end_state import (
    check_held,
    check_limit,
    check_rolling,
    end_warnings,
    idle_note,
    overlap_warnings,
    tip_warnings,
)
from mlsanm_cli.app.checks.energy import energy_error
from mlsanm_cli.app.checks.overlaps import check_overlaps, within_themselves
from mlsanm_cli.app.checks.peaks import Peak, boundary_peaks, check_peaks
from mlsanm_cli.app.checks.quality import assess, factor_notes, nodal_warnings
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.checks.refinement import Adapted, Refinement, adapt, refine_again
from mlsanm_cli.app.checks.verdicts import (
    BALANCE_LIMIT,
    ENERGY_LIMIT,
    LARGE_ERROR,
    LINEAR_LIMIT,
    TRANSFER_LIMIT,
    EnergyVerdict,
    check_balance,
    check_energy,
    check_estimates,
    check_linear,
    check_open,
    check_points,
    check_spacing,
    check_state,
    check_transfer,
    estimate_limits,
    force_balance,
    force_mismatch,
    worst_of,
)
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.output.analysis import Analysis, BodyFields, Ending, Warn
from mlsanm_cli.app.output.lines import contact_lines, large_slides, obstacle_lines
from mlsanm_cli.app.output.parts import body_datasets, contact_datasets, contact_figures, vtu_states
from mlsanm_cli.app.output.views import Views, shown_fields
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.causes import strain_warnings
from mlsanm_cli.case import Case
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.laws.limit_load import SlidingError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io.records import Quantities, place
from mlsanm_cli.io.run_file import Value
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.memo import digest
from mlsanm_cli.solve.coercivity import stability_limit
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import NO_STARTS, Fields, fields_of
from mlsanm_cli.solve.functionals import cone_ratio, contact_values, plates_turned, quantities, slave_arc
from mlsanm_cli.solve.limit_loads import at_limit
from mlsanm_cli.solve.paths import path_of
from mlsanm_cli.solve.state import Checkpoint, PathStep, State
from mlsanm_cli.solve.stop_events import StoppedPath

WITH_STRESS = {"stress", "von_mises", "strain"}
"""Fields that need stresses."""


def set_up(
    case: Case, prepared: SceneModel, context: RunContext, warn: Warn, refinement: Refinement | None = None
) -> Adapted:
    """Condenses the scene, refined as the case requires or by a ``refinement`` found before. Raises
    NumericalError for a scene that cannot be set up."""
    if refinement is None:
        adapted = adapt(case, prepared, context)
    else:
        adapted = refine_again(case, refinement, context)
    nodal = [pairing for pairing in adapted.built.condensed.pairings if pairing.grid is None]
    if adapted.refinement.failed:
        warn(adapted.refinement.failed)
    for warning in nodal_warnings(adapted.prepared, nodal, adapted.prepared.models):
        warn(warning)
    return adapted


class SmallStrain(Analysis):
    """The analysis at small strain; ``refinement`` is that of an earlier process."""

    def __init__(
        self,
        case: Case,
        prepared: SceneModel,
        context: RunContext,
        refinement: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(case, prepared, context)
        self._known = Refinement.read(refinement) if refinement else None
        self._adapted: Adapted | None = None
        self._views = Views({}, {})
        self._path: StoppedPath | None = None
        self._first: State | None = None
        self._stressed: tuple[State, Mapping[str, Fields]] | None = None
        self._energies: EnergyVerdict | None = None
        self._peaks: Mapping[str, Peak] = {}

    @property
    def _built(self) -> CondensedScene:
        assert self._adapted is not None
        return self._adapted.built

    @property
    def _starts(self) -> Mapping[str, Any]:
        """Approximate solutions by body, from the error estimate."""
        if self._adapted is None:
            return NO_STARTS
        return {name: body.solution for name, body in self._adapted.accuracy.bodies.items()}

    def set_up(self, warn: Warn) -> None:
        """Condenses and refines the scene."""
        adapted = set_up(self.case, self.prepared, self.context, warn, self._known)
        self._adapted, self.prepared = adapted, adapted.prepared
        if adapted.refined:
            self.quality = assess(self.case, adapted.prepared, self.context.memo)
            for warning in self.quality.warnings:
                warn(warning)
        models = {name: body.model for name, body in adapted.built.scene.bodies.items()}
        self.quality = replace(self.quality, models=models)

    def steps(self, start: Checkpoint | None, last: State | None, warn: Warn) -> Iterator[PathStep]:
        """The path up to a stop of the case, or its part after a checkpoint."""
        built = self._built
        self._path = StoppedPath(built, start, last, path_of)
        steps = self._path.steps()
        while True:
            try:
                step = next(steps, None)
                for state in (*step.saved, step.state) if step is not None else ():
                    check_rolling(built, state)
            except NumericalError as error:
                if last is not None and isinstance(error, SlidingError):
                    for warning in filter(None, (check_limit(built, last),)):
                        warn(warning)
                position = 0.0 if last is None else last.position
                raise at_limit(built.scene, built.condensed, built.stages, position, error) from error
            if step is None:
                return
            last = step.state
            self._first = self._first or last
            yield step

    def check(self, state: State) -> None:
        """Raises NumericalError for a state that is not reliable."""
        check_state(self._built, state)

    def ending(self, last: State | None) -> Ending:
        """The end of the path, also by a stop of the case."""
        reached = self._path.reached if self._path is not None else None
        if reached is None or last is None:
            return super().ending(last)
        stop = reached.description
        return Ending("done", f"{stop}, at position {last.position:.9g}", stopped_by=stop)

    def judge(self, last: State, tally: dict[str, Any], warn: Warn) -> None:
        """Checks the last state, and estimates its errors."""
        built, context = self._built, self.context
        with context.phase("output"):
            if "linear_residual" not in tally:
                tally["linear_residual"] = self._linear_residual(last)
        check_linear(tally["linear_residual"])
        check_spacing(built, last)
        with context.phase("output"):
            fields = self._stress_fields(last)
            self._energies = energy_error(built, last, fields)
            self._peaks = boundary_peaks(built, last, fields)
        for warning in filter(None, self._warnings(last, tally)):
            warn(warning)
        if note := idle_note(built, last):
            context.console.note(note)
        self._adapted = self._estimated(last)
        known = self._adapted.accuracy
        for warning in check_estimates(built, known.figures(built, last), known.missing):
            warn(warning)

    def _linear_residual(self, last: State) -> float:
        """Error of the linear solver in the last state if no state was saved, which is then also checked for
        overlaps."""
        fields, residual = fields_of(self._built, [last], stress=False, starts=self._starts)[0]
        clouds = {name: body.model.cloud for name, body in self._built.scene.bodies.items()}
        check_overlaps(self._built, last, clouds, {name: one.displacement for name, one in fields.items()})
        return residual

    def _stress_fields(self, state: State) -> Mapping[str, Fields]:
        """The fields of all bodies with stresses; recomputed unless the state was the last one saved."""
        if self._stressed is not None and self._stressed[0] is state:
            return self._stressed[1]
        return fields_of(self._built, [state], stress=True, starts=self._starts)[0][0]

    def _warnings(self, last: State, tally: Mapping[str, Any]) -> Iterator[str]:
        """Warnings about a completed path, "" for checks without findings. A check may raise NumericalError;
        the warnings before it are kept."""
        built, energies = self._built, self._energies
        assert energies is not None
        if self._first is not None:
            yield from overlap_warnings(built, self._first, last)
        yield from end_warnings(built, last)
        yield from tip_warnings(built, last)
        # First of the checks that fail for inconsistent units, so that the warning names the cause.
        yield from strain_warnings(built.case, energies.strains)
        yield from check_transfer(built, last)
        yield check_balance(built.case, force_balance(built, last))
        yield check_energy(built.case, energies)
        yield from check_points(energies)
        yield from check_peaks(built.case, self._peaks)
        yield check_held(built)
        yield check_rolling(built, last)
        yield check_open(built)
        yield from built.weak

    def _estimated(self, last: State) -> Adapted:
        """The scene with the error estimates of its last state."""
        assert self._adapted is not None
        accuracy = self._adapted.accuracy
        if len(self._built.condensed.friction_nodes):
            from mlsanm_cli.app.checks.friction_accuracy import with_friction

            with self.context.phase("estimate"):
                accuracy = with_friction(self._built, accuracy, last, self.context.memo)
        return replace(self._adapted, accuracy=accuracy.with_energies(self._energies))

    @property
    def refinement(self) -> Mapping[str, Any]:
        """Zones and passes of refined clouds."""
        adapted = self._adapted
        return asdict(adapted.refinement) if adapted is not None and adapted.refined else {}

    def model_datasets(self) -> dict[str, Value]:
        """Bodies and contacts before loading, and the maps of bonds."""
        built = self._built
        self._views = Views.of(built, self.context.memo)
        self.clouds = self._views.clouds
        datasets: dict[str, Value] = {}
        for name, cloud in self.clouds.items():
            datasets |= body_datasets(name, cloud, built.scene.bodies[name].model.settings.degree)
        for pairing in built.condensed.reported:
            normal, weight = pairing.normal[pairing.candidate], pairing.weight[pairing.candidate]
            points, arc = pairing.points[pairing.candidate], slave_arc(pairing)
            datasets |= contact_datasets(pairing.name, points, normal, arc, weight)
        bonds = built.condensed.bonds
        for name, own in bonds.spans.items() if bonds.pairings else ():
            pair = (bonds.pressure.take(own), bonds.traction.take(own))
            datasets[place("maps", "bonds", name)] = np.concatenate([one.matrix for one in pair])
        return datasets

    @property
    def attributes(self) -> Mapping[str, str]:
        """A digest of the condensed operators, which without the loads determine the path, and the number of
        nodes."""
        built, condensed = self._built, self._built.condensed
        maps = (condensed.gap, condensed.slip, condensed.watched, condensed.balance)
        nodes = sum(len(body.model.cloud.points) for body in built.scene.bodies.values())
        return {"cache_hash": digest(maps, condensed.weight), "nodes": str(nodes)}

    def series_maps(self) -> dict[str, Value]:
        """The maps from the unknowns of the series to forces, slips and the values of probes."""
        condensed = self._built.condensed
        slips = {name: condensed.slip.take(own) for name, own in condensed.tangential.items()}
        kinds = (("forces", condensed.forces), ("slip", slips), ("probes", condensed.probes))
        return {place("maps", kind, name): one.matrix for kind, maps in kinds for name, one in maps.items()}

    def quantities(self, state: State) -> Quantities:
        """Load factors, forces, platens, contacts and probes."""
        return quantities(self._built, state)

    def fields(self, states: Sequence[State]) -> Iterator[tuple[BodyFields, Mapping[str, float]]]:
        """The fields of saved states, and the error of the linear solver."""
        stress = bool(WITH_STRESS & set(self.fields_written))
        known = fields_of(self._built, states, stress, self._starts)
        for state, (fields, residual) in zip(states, known, strict=True):
            if stress:
                self._stressed = state, fields
            shown = shown_fields(self._built, self._views, state, fields, stress)
            yield shown, {"linear_residual": residual}

    def faults(self, state: State, fields: BodyFields) -> Iterator[tuple[str, str]]:
        """Bodies that overlap themselves, and surfaces that slide far. Raises NumericalError if bodies
        overlap."""
        moved = {name: one.displacement for name, one in fields.items()}
        check_overlaps(self._built, state, self.clouds, moved)
        yield from large_slides(self._built, state, self.clouds, moved)
        for name, (x, y) in within_themselves(self.clouds, moved).items():
            yield (
                f"body {name} overlaps itself",
                f" near ({x:.6g}, {y:.6g}) from position {state.position:.6g} on: self-contact is not "
                "supported, and results beyond that position are invalid",
            )

    def lines(self, state: State, fields: BodyFields) -> tuple[Mapping[str, VtuPart], Mapping[str, VtuPart]]:
        """Slave surfaces and obstacles."""
        contacts = contact_lines(self._built, state, self.clouds, fields)
        return contacts, obstacle_lines(self._built, state)

    def tallied(self, tally: Mapping[str, Any], before: State | None, step: PathStep) -> dict[str, Any]:
        """The largest ratio of tractions to friction limits by contact."""
        cone = dict(tally.get("cone", {}))
        for name in self._built.condensed.tangential:
            ratios = [cone_ratio(self._built, name, state) for state in (step.state, *step.saved)]
            cone[name] = max(cone.get(name, 0.0), *ratios)
        return {"cone": cone}

    def progress(self, step: PathStep) -> list[str]:
        """Closed nodes and peak pressure."""
        state = step.state
        if not len(state.pressure):
            return []
        return [f"closed {int(state.closed.sum())}", f"peak pressure {state.pressure.max(initial=0.0):.6g}"]

    def diagnosis(self, state: State | None) -> tuple[Sequence[VtuPart], Mapping[str, Any]]:
        """The bodies in the state of a failed run with residuals of contact nodes, and the worst nodes."""
        if self._adapted is None or state is None:
            return super().diagnosis(state)
        built = self._built
        cause = diagnose(built, state)
        fields, _ = fields_of(built, [state], stress=True)[0]
        clouds = {name: body.model.cloud for name, body in built.scene.bodies.items()}
        bodies = vtu_states(clouds, fields, ("displacement", "stress", "von_mises"))
        if len(cause.residual):
            more = node_fields(built, cause)
            bodies = {k: replace(body, data={**body.data, **more[k]}) for k, body in bodies.items()}
        return list(bodies.values()), {
            "position": state.position,
            "worst_nodes": worst_nodes(built, cause),
        }

    def interfaces(self, state: State) -> Mapping[str, Mapping[str, Any]]:
        """Columns of the tables of all contacts."""
        tables = {}
        for pairing in self._built.condensed.reported:
            values, points = contact_values(self._built, pairing, state), pairing.points[pairing.candidate]
            place = {"x": points[:, 0], "y": points[:, 1], "arc_length": slave_arc(pairing)}
            columns = ("gap", "pressure", "traction", "slip", "status")
            tables[pairing.name] = place | {name: values[name] for name in columns}
        return tables

    @property
    def notes(self) -> Iterator[str]:
        """Notes on factorisations."""
        return iter(()) if self._adapted is None else factor_notes(self._built.scene)

    def sizes(self, tally: Mapping[str, Any]) -> dict[str, Any]:
        """Numbers of nodes, unknowns and factorisations; passes of the refinement."""
        sizes = {"linear_residual": tally.get("linear_residual"), "stability": None}
        if self._adapted is None:
            return sizes
        built = self._built
        bodies = built.scene.bodies
        nodes = sum(len(body.model.cloud.points) for body in bodies.values())
        if self._adapted.refined:
            sizes["adapt"] = [asdict(one) for one in self._adapted.passes]
        return sizes | {
            "nodes": nodes,
            "unknowns": 2 * nodes,
            "symmetry": _symmetry(built),
            "contact_unknowns": len(built.condensed.weight) + len(built.condensed.friction_nodes),
            "elastic_factorizations": len({id(body.system) for body in bodies.values()}),
            "condensation_solves": built.condensed.solves,
            "enlarged_stencils": sum(body.model.stencils.enlarged for body in bodies.values()),
            "stability": built.stability,
        }

    def figures(self, state: State, tally: Mapping[str, Any]) -> dict[str, Any]:
        """Contacts, plates, balances, errors and estimates of a state."""
        built, adapted = self._built, self._adapted
        assert adapted is not None
        imbalance, lost, cone = force_balance(built, state), force_mismatch(built, state), tally["cone"]
        energies = dict(self._energies.bodies) if self._energies else {}
        contacts = {
            one.name: _contact(built, one, state)
            | {"max_cone_ratio": cone.get(one.name), "force_mismatch": lost.get(one.name)}
            for one in built.condensed.reported
        }
        plates = {"plates": plates_turned(built, state)} if built.condensed.moments else {}
        return plates | {
            "contacts": contacts,
            "error_estimate": adapted.accuracy.figures(built, state),
            "peak_stress": {name: asdict(peak) for name, peak in self._peaks.items()},
            "force_balance": imbalance[worst_of(imbalance)],
            "force_balance_bodies": imbalance,
            "energy_error": energies[worst_of(energies)] if energies else None,
            "energy_error_bodies": energies,
        }

    def limits(self) -> dict[str, Any]:
        """The limits beyond which a run fails: ``stability`` is a lower limit, ``error_estimate`` and
        ``estimates`` only warn."""
        limits: dict[str, Any] = {
            "residual": self.case.solver.tolerance,
            "linear_residual": LINEAR_LIMIT,
            "force_balance": BALANCE_LIMIT,
            "force_mismatch": TRANSFER_LIMIT,
            "energy_error": ENERGY_LIMIT,
            "error_estimate": LARGE_ERROR,
        }
        if self._adapted is None:
            return limits
        built = self._built
        lowest = stability_limit(built.ends)
        return limits | {"stability": lowest, "estimates": estimate_limits(built)}


def _contact(built: CondensedScene, pairing: Pairing, state: State) -> dict[str, Any]:
    """The figures of a contact, with those of the reference solution if the case has one."""
    values = contact_values(built, pairing, state)
    pressure, force = values["pressure"], built.condensed.contact_forces[pairing.name](*state.unknowns)
    if pairing.bonded:
        return {
            "peak_pressure": float(pressure.max(initial=0.0)),
            "peak_tension": float(-pressure.min(initial=0.0)),
            "peak_traction": float(np.abs(values["traction"]).max(initial=0.0)),
            "force": force.tolist(),
            "closed_nodes": len(pressure),
            "stick_nodes": len(pressure),
        }
    figures = contact_figures(values, slave_arc(pairing), pressure, force)
    profile = reference_profile(built, pairing, state)
    if profile is not None:
        figures["reference"] = {
            "solution": built.case.reference.solution if built.case.reference else None,
            "peak_pressure": profile.peak,
            "half_width": profile.half_width,
            "pressure_error_l2": profile.error_l2,
        }
    return figures


def _symmetry(built: CondensedScene) -> str | None:
    """The symmetry line of the nodes of all bodies, None if there is none."""
    mirrors = [body.model.cloud.mirror for body in built.scene.bodies.values()]
    lines = {None if mirror is None else str(mirror.line) for mirror in mirrors}
    return lines.pop() if len(lines) == 1 else None
