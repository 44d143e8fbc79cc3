"""Open recordings in the Rerun viewer; without a display, have a browser show them.

Usage: python -m scripts.view [AGENT] (`make view`)
"""

import os
import subprocess
import sys

from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.sim.gl import has_display


def main() -> int:
    """Parse the command line and open; return Rerun's exit status.

    Raises:
        InputError: There is no such recording.
    """
    parser = command_line.parser(__doc__)
    parser.add_argument("agent", nargs="?", help="one agent, or `lineup`; by default all")
    agent = parser.parse_args().agent
    paths = {path.stem: str(path) for path in sorted(PROJECT_ROOT.glob("media/*.rrd"))}
    if not paths or agent not in (None, *paths):
        given = f"given {agent!r}, allowed: {', '.join(paths)}" if paths else "there are none yet"
        raise InputError(f"recordings in media/: {given}; `make repro` makes them")
    command = ["rerun", "--bind", "127.0.0.1", *([paths[agent]] if agent else paths.values())]
    if not has_display():
        command.insert(1, "--web-viewer")
        print(
            "No display here: a browser shows it at the last address below. Ctrl-C ends it.",
            flush=True,
        )
    # It sends no telemetry if CI is set; its own switch for that changes the user's settings.
    return subprocess.run(command, env=os.environ | {"CI": "1"}).returncode


if __name__ == "__main__":
    with reported():
        sys.exit(main())
