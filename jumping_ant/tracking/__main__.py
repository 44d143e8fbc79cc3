"""Follow an agent's training in MLflow, until standard input ends.

Usage: python -m jumping_ant.tracking follow <agent> [--after SECONDS] [--root FOLDER]

The training process keeps the other end of the pipe that is standard input. It writes its
parameters there, as JSON in a line. However training ends, the pipe closes; the rest is logged
then. One that ends before the given time is left to `track`.
"""

import json
import os
import select
import signal
import sys
from pathlib import Path

from jumping_ant.base import command_line, output
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT

NICENESS = 10  # training comes first where both share a core


def main() -> None:
    """Parse the command line and follow; an error ends in one line and exit status 0."""
    parser = command_line.parser(__doc__, "python -m jumping_ant.tracking")
    parser.add_argument("command", choices=["follow"])
    parser.add_argument("agent", help="name of the agent in params.yaml")
    parser.add_argument("--after", type=float, default=0.0, help="seconds to wait first")
    parser.add_argument("--root", type=Path, default=PROJECT_ROOT, help="the project folder")
    arguments = parser.parse_args()
    output.tolerate_failures()
    os.nice(NICENESS)
    command_line.collect_garbage_rarely()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C stops the training, then the pipe closes

    params = sys.stdin.readline()

    def has_ended(seconds: float) -> bool:
        readable, _, _ = select.select([sys.stdin], [], [], seconds)
        return bool(readable and not os.read(sys.stdin.fileno(), 4096))

    if not params or (arguments.after > 0 and has_ended(arguments.after)):
        return

    from jumping_ant.params import params_file
    from jumping_ant.tracking import live  # imports MLflow, with the settings above

    try:
        checked = params_file.check(json.loads(params))
        live.follow(arguments.agent, arguments.root, checked, has_ended)
    except InputError as error:
        print(f"warning: no live curves: {error}", file=sys.stderr)


if __name__ == "__main__":
    main()
