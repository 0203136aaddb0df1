"""The content of summary.json."""

from __future__ import annotations

from typing import Any

from mlsanm_cli.app.output.analysis import Analysis, Ending
from mlsanm_cli.app.output.recorder import Recorder
from mlsanm_cli.errors import UnstableError
from mlsanm_cli.system import peak_memory_mb


def summarise(analysis: Analysis, ending: Ending, recorder: Recorder) -> dict[str, Any]:
    """The content of summary.json, as far as known when the run ended."""
    state, tally, context = recorder.last, recorder.tally, analysis.context
    summary: dict[str, Any] = {
        "status": ending.status,
        "stop_reason": ending.reason,
        "position": state.position if state else None,
        **{name: tally[name] for name in ("steps", "iterations", "factorizations", "solves")},
    }
    if ending.stopped_by and state is not None:
        factors = dict(zip(analysis.case.moved, state.factors.tolist(), strict=True))
        summary |= {"stopped_at": state.position, "stopped_by": ending.stopped_by, "factors": factors}
    if ending.hint:
        summary["hint"] = ending.hint
    if recorder.failed_at:
        summary["failure"] = recorder.failed_at
    summary |= {"contacts": {}, "residual": tally["residual"], **analysis.sizes(tally)}
    if state is not None:
        quantities = analysis.quantities(state)
        summary["forces"] = {name: force.tolist() for name, force in quantities["resultants"].items()}
        if quantities["probes"]:
            summary["probes"] = {
                name: values | {key: values[key].tolist() for key in ("displacement", "stress")}
                for name, values in quantities["probes"].items()
            }
        summary |= analysis.figures(state, tally)
    if isinstance(ending.error, UnstableError) and summary.get("stability") is None:
        summary["stability"] = ending.error.stability
    return summary | {
        "quality": analysis.quality.figures,
        "limits": analysis.limits(),
        "seconds": context.clock.seconds,
        "wall_seconds": context.clock.wall_seconds,
        "peak_memory_mb": peak_memory_mb(),
        "warnings": recorder.warnings,
        "checks": recorder.verdicts.rows,
        "cache": context.memo.figures,
    }
