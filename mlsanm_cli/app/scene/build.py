"""The scene of a case on its clouds: kernels, nodes, operators, pairs and conditions."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import NOTHING, SceneModel, prepare
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.app.scene.contact_pairs import refuse_overlap
from mlsanm_cli.app.scene.size_estimate import refuse_too_large, refuse_too_many_contacts
from mlsanm_cli.case import Case, LoadedCase, resolved_mapping
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.errors import CaseError
from mlsanm_cli.kernels.aot.jit import is_warm, load
from mlsanm_cli.kernels.aot.machine import Machine
from mlsanm_cli.memo import digest

ANNOUNCED_NODES = 50_000
"""Scenes with more nodes are announced: they take long, and may be due to a typing error."""
_SECTIONS_WITHOUT_SIZE = {"load", "stage", "output"}
_CONTACT_KEYS_WITHOUT_SIZE = {"friction", "regularization"}
"""Sections of a case and keys of its contacts that do not affect its size."""
_OUTPUT_SECTIONS = {"title", "output"}
"""Sections of a case that only affect what is written."""


def load_kernels(context: RunContext) -> Machine:
    """Loads the compiled kernels; announces compilation, and warns if they cannot be kept."""
    with context.phase("jit"):
        if not is_warm():
            context.console.phase("compiling kernels, once for this installation (10 to 20 s)")
        loaded = load()
    if loaded.note:
        context.console.warning(loaded.note)
    return loaded


def build_scene(loaded: LoadedCase, context: RunContext, zones: tuple[Zone, ...] = ()) -> SceneModel:
    """The scene on its clouds, refined in ``zones``, with all checks that precede solving. Raises CaseError
    for a scene that exceeds the memory, and for invalid contacts and platens."""
    load_kernels(context)
    try:
        with context.phase("cloud"):
            boundaries = Boundaries.of(loaded.case)
            key, estimate = _size_key(loaded.case), partial(refuse_too_large, boundaries)
            nodes, memory = context.memo.value("size", key, estimate)
        if nodes > ANNOUNCED_NODES:
            context.console.note(
                f"about {nodes:.2g} nodes, which need about {memory / 1024:.2g} GB of memory"
            )
        prepared = place(boundaries, context, zones)
        refuse_too_many_contacts(loaded.case, prepared.pairings)
        refuse_overlap(loaded.case.contact, prepared.pairings)
    except CaseError as error:
        raise loaded.located(error) from error
    return prepared


def placing_key(case: Case) -> str:
    """A key that is equal for cases that differ only in output and in positive coefficients of friction."""
    content = {key: part for key, part in resolved_mapping(case).items() if key not in _OUTPUT_SECTIONS}
    contacts = zip(content.pop("contact", []), case.contact, strict=True)
    kinds = [
        (part, contact.friction if contact.bonded else contact.coefficient > 0.0)
        for part, contact in contacts
    ]
    return digest(content, [{**part, "friction": kind} for part, kind in kinds])


def _size_key(case: Case) -> str:
    """A key that is equal for cases of equal size."""
    content = {key: part for key, part in resolved_mapping(case).items() if key not in _SECTIONS_WITHOUT_SIZE}
    contacts = [
        {key: part for key, part in contact.items() if key not in _CONTACT_KEYS_WITHOUT_SIZE}
        for contact in content.pop("contact", [])
    ]
    return digest(content, contacts)


def place(
    boundaries: Boundaries,
    context: RunContext,
    zones: tuple[Zone, ...] = (),
    before: SceneModel | None = None,
) -> SceneModel:
    """Clouds, stencils, pairs and conditions; ``zones`` refine every body in addition to the case, and bodies
    equal to those ``before`` are reused. Cases that differ in coefficients of friction share them."""
    if zones or before is not None:
        return _placed(boundaries, context, zones, before)
    case = boundaries.case
    kept = context.memo.value("placed", placing_key(case), partial(_placed, boundaries, context))
    friction = {contact.name: contact.coefficient for contact in case.contact}
    pairings = (replace(pairing, friction=friction[pairing.name]) for pairing in kept.pairings)
    return replace(kept, boundaries=replace(kept.boundaries, case=case), pairings=tuple(pairings))


def _placed(
    boundaries: Boundaries,
    context: RunContext,
    zones: tuple[Zone, ...] = (),
    before: SceneModel | None = None,
) -> SceneModel:
    with context.phase("cloud", "placing nodes"):
        placed = clouds(boundaries, zones, context.memo)
    with context.phase("operators", "building operators"):
        return prepare(boundaries, placed, context.memo, before.models if before is not None else NOTHING)
