"""Search for an agent's settings, and judge the best on fresh seeds.

Usage: python -m scripts.tune AGENT [--trials N] [--sampler random] [--storage ADDRESS]
    [--preset NAME] (`make tune AGENT=sac TRIALS=40`)

`tuning` in params.yaml says how; docs/how-it-works.md explains. The trials are a study of Optuna in
`.tuning/`, which resumes where it was stopped. Writes results/tuning/AGENT.csv and .json, and, if
better settings were found, the preset tuned-AGENT.
"""

import argparse
import sys
from typing import get_args

from jumping_ant.base import command_line, output
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file, presets
from jumping_ant.tuning import tune
from jumping_ant.tuning.search import SamplerName


def main() -> None:
    """Parse the command line, search, and bring MLflow up to date."""
    parser = command_line.parser(__doc__)
    parser.add_argument("agent", help="name of an agent that learns")
    parser.add_argument("--trials", type=_count, help="by default tuning.trials of params.yaml")
    parser.add_argument("--sampler", choices=get_args(SamplerName), default="tpe")
    parser.add_argument("--storage", help="address of another storage than a file in .tuning/")
    parser.add_argument("--preset", help="of which the agent is, if params.yaml has none such")
    given = parser.parse_args()
    params = presets.load(given.preset) if given.preset else params_file.load()
    tuning = params.tuning.model_copy(update={"trials": given.trials or params.tuning.trials})
    params = params.model_copy(update={"tuning": tuning})
    tune.run(PROJECT_ROOT, params, given.agent, given.sampler, given.storage)
    from jumping_ant.tracking import studies  # takes seconds, which the search does not wait for

    try:
        studies.track(PROJECT_ROOT, print)
    except InputError as error:
        print(f"warning: {error}; `make ui` brings it up to date later", file=sys.stderr)


def _count(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f"given {text!r}, allowed: 1 or more")
    return int(text)


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
