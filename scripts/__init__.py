"""Commands about the project as a whole; Ctrl-C ends any of them in a line."""

import sys
from types import TracebackType

import jumping_ant  # noqa: F401  (selects the kernels of numerical libraries, before their import)


def _tell(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """Print what ends a command; after Ctrl-C, Python then ends as shells expect it, with 130."""
    if issubclass(kind, KeyboardInterrupt):
        print("stopped by Ctrl-C", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, traceback)


sys.excepthook = _tell
