"""The stages of `dvc.yaml`, one thin script each; a stage never imports another stage."""

import os
import signal
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from types import FrameType

_BEGAN = time.monotonic()


def _stop(number: int, frame: FrameType | None) -> None:
    """End at once, in one line; imports, renderers and encoders would print tracebacks."""
    with suppress(OSError):
        os.write(2, b"stopped: nothing already computed is lost\n")
    os._exit(130)


# While a stage trains, its driver handles Ctrl-C instead, with a last checkpoint.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _stop)

from jumping_ant.base import command_line, output  # noqa: E402
from jumping_ant.base.errors import reported  # noqa: E402
from jumping_ant.base.files import read_json, write_json  # noqa: E402
from jumping_ant.base.paths import Paths  # noqa: E402
from jumping_ant.params import inputs, params_file  # noqa: E402
from jumping_ant.params.model import Params  # noqa: E402

command_line.switch_off_telemetry()  # before a stage imports tools that have it
command_line.collect_garbage_rarely()  # before it imports much


def parse(docstring: str | None) -> Params:
    """Return all parameters, for a stage that takes no argument."""
    command_line.parser(docstring).parse_args()
    return params_file.load()


def parse_agent(docstring: str | None) -> tuple[str, Params]:
    """Return the agent that the stage is for, and all parameters."""
    agent, settings = parse_key(docstring, "agent")
    settings.agent(agent)
    return agent, settings


def parse_key(docstring: str | None, kind: str) -> tuple[str, Params]:
    """Return the name of what the stage is for, such as an agent, and all parameters.

    A command line may name it. DVC names it in the environment instead, as in `train@sac`: a name
    in a command of `dvc.yaml` would go through a shell, before anything has checked it.
    """
    _, at, name = os.environ.get("DVC_STAGE", "").rpartition("@")
    parser = command_line.parser(docstring)
    parser.add_argument(kind, nargs="?" if at else None, default=name)
    return getattr(parser.parse_args(), kind), params_file.load()


def run(main: Callable[[], None]) -> None:
    """Run a stage's `main`; a failure of the input or the system prints one line.

    If DVC runs it, what it depends on may not change meanwhile, as DVC looks at it only afterwards.
    """
    output.tolerate_failures()
    stage = os.environ.get("DVC_STAGE", "").rpartition(":")[2]
    with reported(), inputs.unchanged(stage) if stage else nullcontext():
        main()
    _note_seconds(stage)


def _note_seconds(stage: str) -> None:
    """Note what a stage took that DVC runs, for the list of `make repro`."""
    if stage:
        path = Paths().seconds
        with suppress(OSError, ValueError):
            noted = read_json(path, stage) if path.exists() else {}
            write_json(path, noted | {stage: round(time.monotonic() - _BEGAN, 1)})
