"""Train as the article does, over several seeds, and check whether its printed values recur.

Usage: python -m scripts.article [--measure] [--folder FOLDER] [--tests TESTS]

Runs the whole pipeline with `presets/article` in a copy of the project, `.presets/article/`, which
takes hours (see scripts.preset). Then tests the trained agents as the article did, which takes
minutes, and writes results/article.json and results/article/*.png. What is said of DQN's printed
value rests on all seeds of its run in results/article_tests.csv (see `scripts.article_runs`).
"""

import time
from pathlib import Path
from typing import Any

from jumping_ant.agents import catalogue
from jumping_ant.article import figures as article_figures
from jumping_ant.article import reproduction
from jumping_ant.base import command_line, machine, output
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT, write_bytes, write_json
from jumping_ant.experiment import params_file, presets
from jumping_ant.experiment.models import Params
from jumping_ant.looks.looks import looks
from scripts import article_runs, preset

RESULTS = PROJECT_ROOT / "results"


def main() -> None:
    """Parse the command line, run and measure."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--measure", action="store_true", help="only measure what is trained")
    parser.add_argument(
        "--folder",
        type=Path,
        default=preset.folder_of("article"),
        help="where the trained agents are",
    )
    parser.add_argument(
        "--tests", type=int, default=reproduction.NUM_TESTS, help="of each policy [%(default)s]"
    )
    options = parser.parse_args()
    if options.tests < 1:
        parser.error(f"--tests: given {options.tests}, allowed: 1 or more")
    if not options.measure:
        preset.run(options.folder, presets.load("article"))
    started = time.perf_counter()
    content = measure(options.folder, options.tests)
    hours = content["training"]["hours_on_2_cores"]
    print(
        f"training took {hours:.2g} hours on 2 cores (the measured seconds of all seeds, halved), "
        f"measuring {time.perf_counter() - started:.0f} s"
    )


def measure(folder: Path, num_tests: int) -> dict[str, Any]:
    """Measure the trained agents of a project, and write the results into this one.

    Args:
        folder: Folder of the project that trained them.
        num_tests: Number of tests of each policy.

    Returns:
        The content of `results/article.json`.

    Raises:
        InputError: Nothing is trained there.
    """
    if not (folder / "params.yaml").exists():
        raise InputError(f"{folder}: given no project, allowed: what `make article` has trained")
    params = params_file.load(folder / "params.yaml")
    measured = reproduction.reproduce(folder, params, num_tests)
    is_articles = _settings(params) == _settings(presets.load("article"))
    content = measured.summary() | {
        "article_settings": is_articles,
        "machine": machine.describe() | {"cores": machine.num_cores()},
    }
    tests = article_runs.tests(article_runs.PATH, "preset")
    if is_articles and len(tests):
        dqn = content["printed"]["dqn"]
        dqn |= reproduction.place(dqn["value"], tests)
    write_json(RESULTS / "article.json", content)
    own = looks({name: catalogue.row(agent).family for name, agent in params.agents.items()})
    for name, figure in article_figures.draw(measured, own).items():
        write_bytes(RESULTS / "article" / f"{name}.png", article_figures.picture(figure))
    return content


def _settings(params: Params) -> list[Any]:
    """Return all parameters that the trained agents depend on, except the seeds."""
    return [params.robot, params.env, *(params.agent(name) for name in reproduction.AGENTS)]


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
