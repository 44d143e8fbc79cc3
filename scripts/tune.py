"""Search for an agent's settings, and judge the best on fresh seeds.

Usage: python -m scripts.tune AGENT [--sampler random] [--storage ADDRESS] [--preset NAME]
    [--trials N] [--seeds N] ... (`make tune AGENT=sac TRIALS=40`)

Further arguments are those of `SearchSettings`; docs/how-it-works.md explains. The trials are a
study of Optuna in `.tuning/`, which resumes where it was stopped. Writes results/tuning/AGENT.csv
and .json, and, if better settings were found, the preset tuned-AGENT.
"""

import sys
from dataclasses import fields
from typing import get_args

from pydantic import TypeAdapter, ValidationError

from jumping_ant.base import command_line, output
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file, presets
from jumping_ant.tuning import tune
from jumping_ant.tuning.search import SamplerName
from jumping_ant.tuning.task import SearchSettings


def main() -> None:
    """Parse the command line, search, and bring MLflow up to date."""
    parser = command_line.parser(__doc__)
    parser.add_argument("agent", metavar="AGENT", help="one that learns, as in AGENT=sac of make")
    parser.add_argument("--sampler", choices=get_args(SamplerName), default="tpe")
    parser.add_argument("--storage", help="address of another storage than a file in .tuning/")
    parser.add_argument("--preset", help="of which the agent is, if params.yaml has none such")
    names = {field.name: f"--{field.name.replace('_', '-')}" for field in fields(SearchSettings)}
    for field in fields(SearchSettings):
        parser.add_argument(names[field.name], help=f"by default {field.default}")
    arguments = parser.parse_args()
    numbers = {name: it for name in names if (it := getattr(arguments, name)) is not None}
    try:
        settings = TypeAdapter(SearchSettings).validate_python(numbers)
    except ValidationError as error:
        fault = error.errors()[0]
        name = names[str(fault["loc"][0])]
        raise InputError(f"{name}: given {fault['input']!r}: {fault['msg']}") from error
    params = presets.load(arguments.preset) if arguments.preset else params_file.load()
    tune.run(PROJECT_ROOT, params, arguments.agent, settings, arguments.sampler, arguments.storage)
    from jumping_ant.tracking import studies  # takes seconds, which the search does not wait for

    try:
        studies.track(PROJECT_ROOT, print)
    except InputError as error:
        print(f"warning: {error}; `make ui` brings it up to date later", file=sys.stderr)


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
