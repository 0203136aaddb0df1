"""``python -m mlsanm_cli.cli``: the same as the command ``mlsanm``."""

from __future__ import annotations

import sys

from mlsanm_cli.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
