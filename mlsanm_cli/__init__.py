"""mlsanm: frictional contact between elastic bodies in the plane, without a mesh. ``import mlsanm_cli as
mlsanm`` gives the Python interface, see docs/python.md: ``run``, ``check``, ``open``, ``resume``, ``sweep``
and ``collect``. Importing the package loads nothing; the first use does."""

from importlib import import_module as _import_module
from typing import Any as _Any

__version__ = "0.1.0"
_NAMES = {
    name: module
    for module, names in (
        ("errors", ("CaseError", "CaseProblem", "Interrupted", "MlsanmError", "NumericalError", "RunError")),
        ("results", ("Contact", "ContactState", "Run")),
        ("api", ("MlsanmWarning", "check", "collect", "open", "overrides", "resume", "run", "sweep")),
    )
    for name in names
}
"""The modules of the public names."""


def __getattr__(name: str) -> _Any:
    if name not in _NAMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Imported by name: modules of all layers import the version from here, and must not depend on ``api``.
    module = _import_module(f"{__name__}.{_NAMES[name]}")
    return getattr(module, "open_run" if name == "open" else name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_NAMES])
