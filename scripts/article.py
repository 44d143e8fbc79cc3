"""Train as the article does, over several seeds, and check whether its printed values recur.

Usage: python -m scripts.article [--agents AGENT ...] [--seeds SEED ...] [--measure]
    [--folder FOLDER] [--tests TESTS]

Runs the whole pipeline with `presets/article` in a copy of the project, `.presets/article/`, which
takes hours (see scripts.preset). Then tests the trained agents as the article did, which takes
minutes, and writes results/article.json and results/article/*.png. What is said of DQN's printed
value rests on all seeds of its run in results/article_tests.csv (see docs/article.md). With
`--agents` or `--seeds` only these are trained and tested, and the copy's results/ gets the outcome.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jumping_ant.agents import catalogue
from jumping_ant.article import figures as article_figures
from jumping_ant.article import reproduction
from jumping_ant.base import command_line, machine, output
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT, write_bytes, write_json
from jumping_ant.media.style import looks
from jumping_ant.params import params_file, presets
from jumping_ant.params.model import Params
from scripts import preset

RESULTS = PROJECT_ROOT / "results"
MORE_TESTS = RESULTS / "article_tests.csv"


def main() -> None:
    """Parse the command line, run and measure."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--agents", nargs="+", choices=reproduction.AGENTS, help="only these")
    parser.add_argument("--seeds", nargs="+", type=int, help="only train and test these")
    parser.add_argument("--measure", action="store_true", help="only measure what is trained")
    folder = preset.folder_of("article")
    parser.add_argument("--folder", type=Path, default=folder, help="where trained agents are")
    parser.add_argument(
        "--tests", type=int, default=reproduction.NUM_TESTS, help="of each policy [%(default)s]"
    )
    options = parser.parse_args()
    agents = [name for name in reproduction.AGENTS if name in (options.agents or [name])]
    params = presets.load("article")
    if options.seeds:
        seeds = [*dict.fromkeys(options.seeds)]
        params = params_file.check(params.model_dump() | {"seeds": seeds}, "--seeds")
    is_part = bool(options.agents or options.seeds)
    if not options.measure:
        preset.run(options.folder, params, [f"train@{name}" for name in agents] if is_part else ())
    started = time.perf_counter()
    only = agents if is_part else None, params.seeds if options.seeds else None
    content = measure(options.folder, options.tests, *only)
    hours = content["training"]["hours_on_2_cores"]
    print(
        f"training took {hours:.2g} hours on 2 cores (the measured seconds of all seeds, halved), "
        f"measuring {time.perf_counter() - started:.0f} s"
    )


def measure(
    folder: Path,
    num_tests: int,
    agents: Sequence[str] | None = None,
    seeds: Sequence[int] | None = None,
) -> dict[str, Any]:
    """Measure the trained agents of a project; write and return what `results/article.json` gets.

    Args:
        folder: Folder of the project that trained them.
        num_tests: Number of tests of each policy.
        agents: Those to measure, whose results are then written into `folder`; all by default.
        seeds: Those of these to measure; all that are trained by default.

    Raises:
        InputError: Nothing is trained there, or not these seeds.
    """
    if not (folder / "params.yaml").exists():
        raise InputError(f"{folder}: given no project, allowed: what `make article` has trained")
    params = params_file.load(folder / "params.yaml")
    if others := set(seeds or ()).difference(params.seeds):
        allowed = ", ".join(map(str, params.seeds))
        raise InputError(f"--seeds: given {min(others)}, allowed: {allowed}, trained in {folder}")
    measured = reproduction.reproduce(folder, params, num_tests, agents, seeds)
    is_articles = _settings(params) == _settings(presets.load("article"))
    content = measured.summary() | {
        "article_settings": is_articles,
        "machine": machine.describe() | {"cores": machine.num_cores()},
    }
    if is_articles and agents is None and MORE_TESTS.is_file():
        dqn = content["printed"]["dqn"]
        dqn |= reproduction.place(dqn["value"], reproduction.recorded(MORE_TESTS, "preset"))
    results = RESULTS if agents is None else folder / "results"
    write_json(results / "article.json", content)
    drawn = looks({name: catalogue.row(agent).family for name, agent in params.agents.items()})
    for name, figure in article_figures.draw(measured, drawn).items():
        write_bytes(results / "article" / f"{name}.png", article_figures.picture(figure))
    return content


def _settings(params: Params) -> list[Any]:
    """Return all parameters that the trained agents depend on, except the seeds."""
    return [params.robot, params.env, *(params.agent(name) for name in reproduction.AGENTS)]


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
