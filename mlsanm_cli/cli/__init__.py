"""The command line. Importing it loads click and nothing heavy: numerics come in with the commands."""

from __future__ import annotations

from mlsanm_cli.cli.main import main

__all__ = ["main"]
