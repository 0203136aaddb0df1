from mlsanm_cli.api import MlsanmWarning as MlsanmWarning
from mlsanm_cli.api import check as check
from mlsanm_cli.api import collect as collect
from mlsanm_cli.api import open_run
from mlsanm_cli.api import overrides as overrides
from mlsanm_cli.api import resume as resume
from mlsanm_cli.api import run as run
from mlsanm_cli.api import sweep as sweep
from mlsanm_cli.errors import CaseError as CaseError
from mlsanm_cli.errors import CaseProblem as CaseProblem
from mlsanm_cli.errors import Interrupted as Interrupted
from mlsanm_cli.errors import MlsanmError as MlsanmError
from mlsanm_cli.errors import NumericalError as NumericalError
from mlsanm_cli.errors import RunError as RunError
from mlsanm_cli.results import Contact as Contact
from mlsanm_cli.results import ContactState as ContactState
from mlsanm_cli.results import Run as Run

open = open_run  # noqa: A001
__version__: str
_NAMES: dict[str, str]
