"""The content of summary.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from mlsanm_cli.app.checks.quality import Quality
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.checks.refinement import Adapted
from mlsanm_cli.app.checks.verdicts import (
    BALANCE_LIMIT,
    ENERGY_LIMIT,
    LARGE_ERROR,
    LINEAR_LIMIT,
    TRANSFER_LIMIT,
    estimate_limits,
    force_balance,
    force_mismatch,
    worst_of,
)
from mlsanm_cli.app.context import Clock
from mlsanm_cli.app.output import recording
from mlsanm_cli.app.output.recorder import Recorder
from mlsanm_cli.app.output.writer import RunWriter
from mlsanm_cli.case import Case
from mlsanm_cli.io.records import ProbeRecord
from mlsanm_cli.solve.coercivity import stability_limit
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.functionals import plates_turned, probe_record
from mlsanm_cli.solve.state import State
from mlsanm_cli.system import peak_memory_mb


@dataclass(frozen=True)
class Ending:
    """How a run ended: status ("done", "failed" or "stopped"), reason, hint, the coercivity estimate of an
    unstable discretisation, and the ``[[stop]]`` condition that ended it, in words."""

    status: str
    reason: str
    hint: str = ""
    stability: float | None = None
    stopped_by: str = ""


def head(ending: Ending, recorder: RunWriter, steps: int, position: float | None) -> dict[str, Any]:
    """The first entries of every summary."""
    return {
        "status": ending.status,
        "stop_reason": ending.reason,
        "position": position,
        "steps": steps,
        "iterations": recorder.iterations,
        "factorizations": recorder.factorizations,
        "solves": recorder.solves,
    }


def tail(recorder: RunWriter, quality: Quality, limits: Mapping[str, Any], clock: Clock) -> dict[str, Any]:
    """The last entries of every summary."""
    return {
        "quality": quality.figures,
        "limits": limits,
        "seconds": clock.seconds,
        "wall_seconds": clock.wall_seconds,
        "peak_memory_mb": peak_memory_mb(),
        "warnings": recorder.warnings,
    }


def probe_figures(record: ProbeRecord) -> dict[str, Any]:
    """The final values of a probe."""
    return {
        "displacement": record.displacement.tolist(),
        "stress": record.stress.tolist(),
        "von_mises": record.von_mises,
    }


def summarise(
    case: Case, ending: Ending, adapted: Adapted | None, quality: Quality, recorder: Recorder, clock: Clock
) -> dict[str, Any]:
    """The content of summary.json, as far as known when the run ended."""
    built = adapted.built if adapted is not None else None
    state = recorder.last
    summary = head(ending, recorder, recorder.steps, state.position if state else None)
    if ending.stopped_by and state is not None:
        factors = zip(case.moved, state.factors.tolist(), strict=True)
        summary |= {"stopped_at": state.position, "stopped_by": ending.stopped_by, "factors": dict(factors)}
    if ending.hint:
        summary["hint"] = ending.hint
    if recorder.failed_at:
        summary["failure"] = recorder.failed_at
    if built is not None:
        bodies = built.scene.bodies
        nodes = sum(len(body.model.cloud.points) for body in bodies.values())
        summary |= {
            "nodes": nodes,
            "unknowns": 2 * nodes,
            "symmetry": _symmetry(built),
            "contact_unknowns": len(built.condensed.weight) + len(built.condensed.friction_nodes),
            "elastic_factorizations": len({id(body.system) for body in bodies.values()}),
            "condensation_solves": built.condensed.solves,
            "enlarged_stencils": sum(body.model.stencils.enlarged for body in bodies.values()),
        }
    summary["contacts"] = {}
    summary["residual"] = recorder.residual
    summary["linear_residual"] = recorder.linear_residual
    if built is not None and adapted is not None and state is not None:
        imbalance = force_balance(built, state)
        lost = force_mismatch(built, state)
        summary["contacts"] = {
            p.name: _contact(built, p.name, state, recorder.cone.get(p.name))
            | {"force_mismatch": lost.get(p.name)}
            for p in built.condensed.reported
        }
        summary["error_estimate"] = adapted.accuracy.figures(built, state)
        summary["peak_stress"] = {name: asdict(peak) for name, peak in recorder.peaks.items()}
        summary["forces"] = {name: f(*state.unknowns).tolist() for name, f in built.condensed.forces.items()}
        if built.condensed.moments:
            summary["plates"] = plates_turned(built, state)
        if built.condensed.probes:
            summary["probes"] = {
                name: probe_figures(probe_record(built, name, state)) for name in built.condensed.probes
            }
        summary["force_balance"] = imbalance[worst_of(imbalance)]
        summary["force_balance_bodies"] = imbalance
        energies = dict(recorder.energies.bodies) if recorder.energies else {}
        summary["energy_error"] = energies[worst_of(energies)] if energies else None
        summary["energy_error_bodies"] = energies
    summary["stability"] = built.stability if built is not None else ending.stability
    if adapted is not None and adapted.refined:
        summary["adapt"] = [asdict(one) for one in adapted.passes]
    return summary | tail(recorder, quality, limits(case, built), clock)


def limits(case: Case, built: CondensedScene | None) -> dict[str, Any]:
    """The limits beyond which a run fails: ``stability`` is a lower limit, ``error_estimate`` and
    ``estimates`` only warn."""
    found: dict[str, Any] = {
        "residual": case.solver.tolerance,
        "linear_residual": LINEAR_LIMIT,
        "force_balance": BALANCE_LIMIT,
        "force_mismatch": TRANSFER_LIMIT,
        "energy_error": ENERGY_LIMIT,
        "error_estimate": LARGE_ERROR,
    }
    if built is None:
        return found
    return found | {
        "stability": stability_limit(built.ends),
        "estimates": estimate_limits(built),
    }


def _contact(built: CondensedScene, name: str, state: State, cone: float | None) -> dict[str, Any]:
    """The figures of a contact, with those of the reference solution if the case has one."""
    pairing = next(p for p in built.condensed.reported if p.name == name)
    figures = recording.contact_summary(built, pairing, state) | {"max_cone_ratio": cone}
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
