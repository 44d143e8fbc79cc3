"""Retrain published seeds from nothing, and compare every byte with what was published.

Usage: python -m scripts.verify [--agent AGENT] [--seed SEED] [--all]

Takes the commit that last changed results/agents/, whatever was changed since, and runs its code in
a copy: training and evaluation of one seed of one agent, which takes a minute or two; by default of
the first seed of every agent; with --all of everything. Compares policies, learning curves and
held-out episodes with what that commit holds, and models/ where it should hold the same. Where they
differ, says by how much the returns do, and which layer of this machine computes differently (see
scripts.fingerprint); the exit status is 1 then.
"""

import csv
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from jumping_ant.agents.catalogue import demonstrated
from jumping_ant.base import command_line, output
from jumping_ant.base.errors import InputError, WorkerError, reported
from jumping_ant.base.files import PROJECT_ROOT, blamed, read_json
from jumping_ant.base.paths import AgentPaths, Paths
from jumping_ant.params import params_file
from scripts.checkout import Checkout, git


def main() -> None:
    """Parse the command line, retrain and compare."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--agent", default="", help="one agent; by default all")
    parser.add_argument("--seed", type=int, help="one seed; by default the first")
    parser.add_argument("--all", action="store_true", help="every seed")
    options = parser.parse_args()
    if git("rev-parse", "--is-shallow-repository").strip() == "true":
        raise InputError(f"{PROJECT_ROOT}: given a shallow clone, allowed: one with its history")
    commit = git("log", "-1", "--format=%h", "--", "results/agents").strip()
    with tempfile.TemporaryDirectory() as folder:
        published, retrained = Path(folder, "published"), Checkout(Path(folder, "retrained"))
        git("archive", "-o", str(Path(folder, "files.tar")), commit)
        for copy in (published, retrained.folder):
            copy.mkdir()  # Python's tar has a filter in newer versions than the oldest that we run
            subprocess.run(["tar", "-xf", "../files.tar"], cwd=copy, check=True)
        # Not checked: they fit the models of that commit.
        params = params_file.read(published / "params.yaml")
        seeds = params["seeds"] if options.all else [_seed(params, options.seed)]
        agents = [options.agent] if options.agent else list(params["agents"])
        retrained.write_params(chosen(params, agents, seeds))
        _run(retrained, agents)
        are_equal = [
            compare(published, retrained.folder, agent, seed, commit)
            for agent in agents
            for seed in seeds
        ]
    if not all(are_equal):
        from scripts import fingerprint  # imports all libraries, which takes seconds

        fingerprint.compare(fingerprint.published())
        sys.exit(1)


def _seed(params: Mapping[str, Any], seed: int | None) -> int:
    """Return a published seed, by default the first."""
    seeds: list[int] = params["seeds"]
    if seed is not None and seed not in seeds:
        raise InputError(f"seed: given {seed}, allowed: {', '.join(map(str, seeds))}")
    return seeds[0] if seed is None else seed


def chosen(
    params: Mapping[str, Any], agents: Sequence[str], seeds: Sequence[int]
) -> dict[str, Any]:
    """Return the published content of `params.yaml` with these seeds alone."""
    for name in agents:
        if name not in params["agents"]:
            raise InputError(f"agent: given {name!r}, allowed: {', '.join(params['agents'])}")
        imitates = params["agents"][name]["algorithm"] in demonstrated()
        if imitates and list(seeds) != params["seeds"]:
            raise InputError(f"{name}: imitates an agent's seeds together, allowed: --all")
    return {**params, "seeds": list(seeds)}


def _run(project: Checkout, agents: Sequence[str]) -> None:
    """Train and evaluate agents; the pipeline shows its progress."""
    (project.folder / "dvc.lock").unlink()  # of outputs that are not there
    stages = [f"evaluate@{agent}" for agent in agents]
    for command in (["git", "init", "-q"], ["dvc", "repro", *stages]):
        done = subprocess.run(command, cwd=project.folder, env=project.environment)
        if done.returncode:
            raise WorkerError("nothing is compared: the pipeline failed, see above")


def compare(published: Path, retrained: Path, agent: str, seed: int, commit: str) -> bool:
    """Print and return whether a seed's files are equal."""
    theirs, ours = (Paths(root).agent(agent) for root in (published, retrained))
    before, after = digests(theirs, seed), digests(ours, seed)
    names = [path.name for path in ours.seed(seed).files]
    different = [it for it in names if it not in before or before[it] != after.get(it)]
    with blamed(f"evaluate@{agent}", theirs.episodes, ours.episodes):
        then, now = _episodes(theirs, seed), _episodes(ours, seed)
        old, new = (fmean(float(row["return"]) for row in rows) for rows in (then, now))
    if then != now:
        different.append(theirs.episodes.name)
    if different:
        verdict = (
            f"{', '.join(different)} differ from what is published (commit {commit}); mean return "
            f"{new:,.1f}, published {old:,.1f} over {len(then)} episodes"
        )
    else:
        verdict = f"same bytes as published (commit {commit})"
    print(f"{agent} seed {seed}: {verdict}", flush=True)
    return not different and _is_here(Paths().agent(agent), seed, before)


def _is_here(paths: AgentPaths, seed: int, published: Mapping[str, str]) -> bool:
    """Print and return whether models/ holds a seed's published files, where it should."""
    files = paths.seed(seed)
    if not files.folder.exists() or digests(paths, seed) != published:
        return True  # not pulled, or of another training
    given = files.digests()
    others = [name for name, digest in published.items() if given.get(name) != digest]
    told = f"{', '.join(others)} differ" if others else "the same bytes"
    print(f"  in {files.folder}: {told}", flush=True)
    return not others


def digests(paths: AgentPaths, seed: int) -> dict[str, str]:
    """Return the digests of the files that a seed's training wrote, by name."""
    if not paths.training.exists():
        return {}
    found: dict[str, str] = read_json(paths.training, f"train@{paths.models.name}").get(
        str(seed), {}
    )
    return found


def _episodes(paths: AgentPaths, seed: int) -> list[dict[str, str]]:
    """Return a seed's held-out episodes, as they are written."""
    with paths.episodes.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["seed"] == str(seed)]


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
