"""Engines that other packages bring: which are installed."""

from __future__ import annotations

from importlib import metadata


class MissingEngineError(Exception):
    """An engine's package is not installed; ``extra`` of mlsanm would install it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"needs the package {package}, which is not installed")
        self.hint = f"pip install 'mlsanm[{extra}]'"


def installed(package: str, extra: str) -> metadata.Distribution:
    """The distribution called ``package``; MissingEngineError where there is none."""
    try:
        return metadata.distribution(package)
    except metadata.PackageNotFoundError as error:
        raise MissingEngineError(package, extra) from error
