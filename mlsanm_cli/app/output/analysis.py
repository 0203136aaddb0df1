"""The analysis of a scene, at small or at finite strain, as a run and its recorder see it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Generic, NamedTuple, Self, TypeVar

import numpy as np

from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.checks.quality import Quality
from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.output.parts import ContactNodes, model_bodies
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import Refinement
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Stop
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import NumericalError, RunError
from mlsanm_cli.io.run_file import Attribute, Value
from mlsanm_cli.io.schema import Quantities, place
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.solve.state import Checkpoint, Fields, PathStep, State
from mlsanm_cli.solve.stop_events import measured, stopped_path

BodyFields = Mapping[str, Fields]
"""Fields of a state by body."""
Built = TypeVar("Built")
"""The assembled scene, at small or at finite strain."""


class Ending(NamedTuple):
    """How a run ended: status ("done", "failed" or "stopped"), reason, hint, the error, and the ``[[stop]]``
    condition that ended the path, in words."""

    status: str
    reason: str
    hint: str = ""
    error: NumericalError | None = None
    stopped_by: str = ""


class Analysis(ABC, Generic[Built]):
    """The scene of a ``case`` on the clouds ``prepared``, those of a ``known`` refinement if there is one,
    its path, and the results of its states.

    A run calls `set_up`, follows `steps`, and judges the `checks` of every state and those of `judge` at the
    end. ``tally`` are the totals of the path so far, plain values that a checkpoint keeps.
    """

    def __init__(
        self, case: Case, prepared: SceneModel, context: RunContext, known: Refinement | None = None
    ) -> None:
        self.case, self.prepared, self.context, self.known = case, prepared, context, known
        self.quality = Quality(case, prepared, {}, {})
        self._built: Built | None = None

    @property
    def built(self) -> Built:
        """The scene assembled by `set_up`."""
        assert self._built is not None
        return self._built

    def with_case(self, case: Case) -> Self:
        """The same scene for a ``case`` that differs in the method only."""
        other, built = copy(self), self.built
        other.case, other._built = case, replace(built, case=case)  # type: ignore[type-var]
        return other

    @property
    def models(self) -> Mapping[str, BodyModel]:
        return self.prepared.models

    @property
    def nodes(self) -> Mapping[str, Cloud]:
        return {name: model.cloud for name, model in self.models.items()}

    @property
    def points(self) -> FloatArray:
        """Nodes (N, 2) of all bodies."""
        return np.concatenate([cloud.points for cloud in self.nodes.values()])

    @property
    def clouds(self) -> Mapping[str, Cloud]:
        """The points at which fields are written."""
        return self.nodes

    @property
    @abstractmethod
    def contacts(self) -> Mapping[str, ContactNodes]:
        """The slave nodes of all contacts."""

    @abstractmethod
    def set_up(self, verdicts: Verdicts) -> None:
        """Announces and assembles the scene. Raises NumericalError for one that cannot be set up."""

    @abstractmethod
    def steps(self, start: Checkpoint | None, last: State | None, verdicts: Verdicts) -> Iterator[PathStep]:
        """The path, or its part after a checkpoint, whose row was ``last``. Raises NumericalError."""

    @abstractmethod
    def path(self, start: Checkpoint | None = None, at: tuple[float, ...] = ()) -> Iterator[PathStep]:
        """The path of all stages, or its part after a checkpoint, with saved states also ``at`` further
        positions."""

    @abstractmethod
    def checks(self, state: State) -> Iterator[Check]: ...

    @abstractmethod
    def displacement(self, state: State) -> FloatArray:
        """Displacements (N, 2) of the nodes of all bodies."""

    @abstractmethod
    def forces(self, state: State) -> Mapping[str, FloatArray]:
        """Forces (2,) of loads, supports and contacts in a state by name."""

    def stopped(self, start: Checkpoint | None, last: State | None, tolerance: float) -> Iterator[PathStep]:
        """The path up to a ``[[stop]]`` of the case, reached within a ``tolerance``. Raises RunError for a
        stop by an unknown force."""

        def value(stop: Stop, state: State) -> float:
            forces = self.forces(state)
            if stop.what == "force" and stop.of not in forces:
                known = f"there are: {', '.join(forces)}"
                raise RunError(f"[[stop]]: the force of {stop.of} is not known", known)
            weights = {name: nodes.weight for name, nodes in self.contacts.items()}
            return measured(stop, self.quantities(state), forces, weights)

        if start is None or start.ended_by < 0:
            yield from stopped_path(self.case.stop, self.path, value, start, last, tolerance)

    @abstractmethod
    def judge(self, last: State, tally: dict[str, Any]) -> Iterator[Check]:
        """Checks of a completed path by its last state."""

    @property
    @abstractmethod
    def refinement(self) -> Mapping[str, Any]:
        """Plain values that reproduce refined clouds; empty if clouds are those of the case."""

    def model(self) -> tuple[dict[str, Value], Mapping[str, Attribute]]:
        """Datasets of bodies and contacts before loading, and attributes of the file."""
        datasets: dict[str, Value] = {}
        for name, cloud in self.clouds.items():
            index, normal, names = cloud.boundary
            boundary: dict[str, Value] = {"index": index, "normal": normal, "name": list(names)}
            members: dict[str, Value] = {f"boundary/{key}": array for key, array in boundary.items()}
            members |= {"points": cloud.points, "degree": np.array(self.models[name].settings.degree)}
            datasets |= {f"{place('bodies', name)}/{key}": value for key, value in members.items()}
        for name, nodes in self.contacts.items():
            datasets |= {place("contacts", name, key): array for key, array in nodes._asdict().items()}
        return datasets, {}

    def series_maps(self) -> dict[str, Value]:
        """Maps from the unknowns of series to results."""
        return {}

    @abstractmethod
    def quantities(self, state: State) -> Quantities:
        """The quantities of a state that every row has."""

    def row_states(self, step: PathStep) -> Sequence[State]:
        """The states of a step that have rows, the last one its end."""
        return (step.state,)

    @property
    def fields_written(self) -> Sequence[str]:
        """Names of the fields of saved states: in bodies of revolution stresses and the hoop stress."""
        names = tuple(dict.fromkeys(self.case.output.fields))
        return (*names, "stress_zz") if self.case.model.revolved and "stress" in names else names

    @abstractmethod
    def fields(self, states: Sequence[State]) -> Iterator[tuple[BodyFields, Mapping[str, float]]]:
        """The fields of saved states at the points written, and figures of their accuracy. Raises
        NumericalError for states that are not admissible."""

    def field_checks(self, state: State, fields: BodyFields) -> Iterator[Check]:
        """Checks of a saved state with its fields."""
        yield from ()

    @abstractmethod
    def lines(self, state: State, fields: BodyFields) -> tuple[Mapping[str, VtuPart], Mapping[str, VtuPart]]:
        """Slave surfaces of all contacts, and obstacles, in a state."""

    @abstractmethod
    def tallied(self, tally: Mapping[str, Any], before: State | None, step: PathStep) -> dict[str, Any]:
        """The totals of the path that change by a step from a state ``before``."""

    @abstractmethod
    def progress(self, step: PathStep) -> list[str]:
        """Figures of a step for the console."""

    def diagnosis(self, state: State | None) -> tuple[Sequence[VtuPart], Mapping[str, Any]]:
        """The bodies in the ``state`` of a failed run, the model if there is none, and where it is worst."""
        return model_bodies(self.prepared), {}

    @property
    def notes(self) -> Iterator[str]:
        yield from ()

    def sizes(self, tally: Mapping[str, Any]) -> dict[str, Any]:
        """Numbers of nodes, unknowns and factorisations for the summary, also without any state."""
        nodes = sum(len(cloud.points) for cloud in self.nodes.values())
        return {"nodes": nodes, "unknowns": 2 * nodes, "contact_unknowns": 0}

    @abstractmethod
    def figures(self, state: State, tally: Mapping[str, Any]) -> dict[str, Any]:
        """Contacts, plates, balances, errors and estimates of a state for the summary."""

    @abstractmethod
    def limits(self) -> dict[str, Any]:
        """The limits of the checks for the summary."""
