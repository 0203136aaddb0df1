"""mlsanm: frictional contact between elastic bodies in the plane, without a mesh. ``import mlsanm_cli as
mlsanm`` gives the Python interface, see docs/python.md: ``run``, ``check``, ``open``, ``resume``, ``sweep``
and ``collect``. Importing the package loads nothing; the first use does."""

from importlib import import_module as _import_module
from typing import Any as _Any

__version__ = "0.1.0"
_NAMES = {
    **{
        name: name
        for name in (
            *("CaseError", "CaseProblem", "Contact", "ContactState", "Interrupted", "MlsanmError"),
            *("MlsanmWarning", "NumericalError", "Run", "RunError"),
            *("check", "collect", "overrides", "resume", "run", "sweep"),
        )
    },
    "open": "open_run",
}
"""The public names, with their names in the module ``api``."""


def __getattr__(name: str) -> _Any:
    if name not in _NAMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Imported by name: modules of all layers import the version from here, and must not depend on ``api``.
    return getattr(_import_module(f"{__name__}.api"), _NAMES[name])


def __dir__() -> list[str]:
    return sorted([*globals(), *_NAMES])
