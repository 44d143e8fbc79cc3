"""The workspace's agents beside those of another run: is it better, or luck?"""

import subprocess
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_bytes
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import claims
from jumping_ant.comparison.results import AgentResults, seed_means
from jumping_ant.evaluation import episodes
from jumping_ant.params import params_file
from jumping_ant.params.claims import Claim
from jumping_ant.params.model import Params

BEFORE = "before"
WORDS = {
    "supported": "better",
    "refuted": "worse",
    "equivalent": "no difference of practical size",
    "inconclusive": "open",
}
SAME = "the same held-out episodes, to the last digit"


def judge(root: Path, params: Params, revision: str) -> dict[str, tuple[str, str]]:
    """Return of each agent that both runs have how it does now, in a word, and the evidence.

    Args:
        root: The project's folder.
        params: Its parameters.
        revision: A commit, tag or branch of git, or an experiment of DVC, with the other run.

    Raises:
        InputError: There is no such revision, or it has no results.
    """
    commit = resolved(root, revision)
    with TemporaryDirectory() as folder:
        other = Path(folder)
        write_bytes(Paths(other).params, _file(root, commit, "params.yaml"))
        before = params_file.check(
            params_file.read(Paths(other).params), f"{revision}: params.yaml"
        )
        names = [name for name in params.agents if name in before.agents]
        for name in names:
            path = Paths(other).agent(name).episodes
            write_bytes(path, _file(root, commit, path.relative_to(other).as_posix()))
        is_paired = _starts(params) == _starts(before)
        verdicts, agents, asked = {}, dict[str, AgentResults](), []
        for name in names:
            paths = [Paths(folder).agent(name).episodes for folder in (root, other)]
            now, then = _results(root, params, name), _results(other, before, name)
            if is_paired and paths[0].read_bytes() == paths[1].read_bytes():
                verdicts[name] = SAME, ""
                continue
            whom = f"{name}/{BEFORE}" if is_paired else f"{name} {BEFORE}"
            if is_paired:
                now = replace(now, variants={BEFORE: then.quantities})
            agents |= {name: now, whom: replace(then, name=whom)}
            text = f"{name} returns more than before."
            margin = params.compare.margin
            asked.append(
                Claim(text=text, measure="return", agent=name, against=whom, margin=margin)
            )
    for claim, entry in zip(
        asked, claims.judge(asked, agents, params.compare)["claims"], strict=True
    ):
        verdicts[claim.agent] = WORDS[entry["verdict"]], entry["evidence"]
    return {name: verdicts[name] for name in names}


def resolved(root: Path, revision: str) -> str:
    """Return the commit of a revision of git, or of an experiment of DVC.

    Raises:
        InputError: There is none, or several experiments have that name.
    """
    name = f"{revision}^{{commit}}"
    found = _git(root, "rev-parse", "--verify", "--quiet", "--end-of-options", name)
    if found.returncode == 0:
        return found.stdout.decode().strip()
    listed = _git(root, "for-each-ref", "--format=%(objectname) %(refname:lstrip=-1)", "refs/exps")
    experiments = [line.split(" ", 1) for line in listed.stdout.decode().splitlines()]
    commits = {commit for commit, name in experiments if name == revision}
    if len(commits) != 1:
        names = ", ".join(sorted({name for _, name in experiments})) or "none"
        raise InputError(
            f"--against: given {revision[:60]!r}, allowed: a commit, tag or branch of git, or an "
            f"experiment ({names})"
        )
    return commits.pop()


def _file(root: Path, commit: str, name: str) -> bytes:
    shown = _git(root, "show", f"{commit}:./{name}")
    if shown.returncode:
        raise InputError(f"--against: {commit[:9]} has no {name}: commit a run's results")
    return shown.stdout


def _git(root: Path, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(["git", "-C", str(root), *arguments], capture_output=True)
    except (OSError, ValueError) as error:
        raise InputError(f"git: {error}") from error


def _results(root: Path, params: Params, name: str) -> AgentResults:
    played = episodes.read(root, params, name)
    return AgentResults(name, params.agents[name], seed_means(played, params.seeds), {}, played)


def _starts(params: Params) -> list[Any]:
    """Return what says which episodes the seeds play, and in which task."""
    return [params.seeds, params.env.model_dump(), params.evaluate.model_dump()]
