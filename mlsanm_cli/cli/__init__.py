"""The command line. Importing it loads click only; commands import the numerical modules when called."""

from __future__ import annotations

from mlsanm_cli.cli.main import main

__all__ = ["main"]
