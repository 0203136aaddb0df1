"""``python -m mlsanm_cli``: the command ``mlsanm``."""

from __future__ import annotations

import atexit
import os
import sys

from mlsanm_cli.cli.main import main


def command() -> None:
    """Runs the command and ends the process, without the time that taking down its modules costs."""
    code = main()
    if sys.gettrace() is not None or sys.getprofile() is not None:
        sys.exit(code)
    # All files are closed by now, and the streams flushed.
    atexit._run_exitfuncs()
    os._exit(code)


if __name__ == "__main__":
    command()
