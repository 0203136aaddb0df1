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
from mlsanm_cli.case import LoadedCase, resolved_mapping
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.errors import CaseError
from mlsanm_cli.kernels.aot.jit import is_warm, load
from mlsanm_cli.kernels.aot.machine import Machine
from mlsanm_cli.memo import digest

ANNOUNCED_NODES = 50_000
"""Scenes with more nodes are announced: they take long, and may be due to a typing error."""
SECTIONS_WITHOUT_SIZE = {"load", "stage", "output"}
CONTACT_KEYS_WITHOUT_SIZE = {"friction", "regularization"}
"""Sections of a case and keys of its contacts that do not affect its size."""
OUTPUT_SECTIONS = {"title", "output"}
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
            content = resolved_mapping(loaded.case)
            sized = {key: part for key, part in content.items() if key not in SECTIONS_WITHOUT_SIZE}
            contacts = [
                {key: part for key, part in contact.items() if key not in CONTACT_KEYS_WITHOUT_SIZE}
                for contact in sized.pop("contact", [])
            ]
            estimate = partial(refuse_too_large, boundaries)
            nodes, memory = context.memo.value("size", digest(sized, contacts), estimate)
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


def place(
    boundaries: Boundaries,
    context: RunContext,
    zones: tuple[Zone, ...] = (),
    before: SceneModel | None = None,
) -> SceneModel:
    """Clouds, stencils, pairs and conditions; ``zones`` refine every body in addition to the case, and bodies
    equal to those ``before`` are reused. Cases that differ in coefficients of friction share them."""

    def placed() -> SceneModel:
        with context.phase("cloud", "placing nodes"):
            nodes = clouds(boundaries, zones, context.memo)
        with context.phase("operators", "building operators"):
            return prepare(boundaries, nodes, context.memo, before.models if before is not None else NOTHING)

    if zones or before is not None:
        return placed()
    case = boundaries.case
    content = {key: part for key, part in resolved_mapping(case).items() if key not in OUTPUT_SECTIONS}
    contacts = [
        {**part, "friction": contact.friction if contact.bonded else contact.coefficient > 0.0}
        for part, contact in zip(content.pop("contact", []), case.contact, strict=True)
    ]
    kept = context.memo.value("placed", digest(content, contacts), placed)
    friction = {contact.name: contact.coefficient for contact in case.contact}
    pairings = (replace(pairing, friction=friction[pairing.name]) for pairing in kept.pairings)
    return replace(kept, boundaries=replace(kept.boundaries, case=case), pairings=tuple(pairings))
