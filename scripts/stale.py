"""Which stages DVC would run again, and what they wrote the last time."""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import chdir, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from ruamel.yaml import YAML

from jumping_ant.base.errors import WorkerError
from jumping_ant.base.paths import Paths, home
from jumping_ant.experiment import presets
from jumping_ant.experiment.models import Params
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training.checkpoint_key import checkpoint_key
from scripts.checkout import Checkout, renew_project

FIRST = ("digest", "check", "build")  # take seconds, and mostly write the same as before
LINKED = ("models", "results", "media")
COPIED = (".inputs", "assets")  # which the first stages write


def look(folder: Path, targets: Sequence[str] = ()) -> list[str]:
    """Return the names of the stages that DVC would run, in order, after it ran the first ones.

    Whether others run depends on what those write. A stage is stale if DVC says so, or if one is
    that it depends on.

    Args:
        folder: The project's folder.
        targets: Stages to run, with those that they need; all by default.

    Raises:
        WorkerError: One of the first stages failed.
    """
    import networkx as nx  # type: ignore[import-untyped]
    from dvc.exceptions import ReproductionError  # type: ignore[import-untyped]
    from dvc.repo import Repo  # type: ignore[import-untyped]

    with chdir(folder), Repo() as repo:  # DVC reads and prints paths from the current folder
        with repo.lock:
            is_new = any(stage.status() for stage in repo.index.stages if stage.name in FIRST)
        try:
            if is_new:
                repo.reproduce(FIRST[-1])
        except ReproductionError as error:
            raise WorkerError(f"{error}; see its output above") from error
        with repo.lock:
            graph, stale = repo.index.graph, {}
            asked = [stage for stage in graph if stage.name in targets]
            needed = set(asked).union(*(nx.descendants(graph, stage) for stage in asked))
            for stage in nx.dfs_postorder_nodes(graph.subgraph(needed or graph)):
                if any(one in stale for one in graph.successors(stage)) or stage.status():
                    stale[stage] = stage.name
            return list(stale.values())


def written(lock: Path) -> dict[str, float]:
    """Return the bytes that each stage wrote the last time; of a training, for each seed."""
    stages = YAML(typ="safe").load(lock.read_text(encoding="utf-8")) if lock.exists() else {}
    return {
        name: sum(out.get("size", 0) for out in stage.get("outs", ()))
        / (len(stage["params"]["params.yaml"]["seeds"]) if name.startswith("train@") else 1)
        for name, stage in stages.get("stages", {}).items()
    }


@contextmanager
def shadow(source: Path, params: Params | None, overrides: Sequence[str]) -> Iterator[Path]:
    """Make a copy of the project, for a question: what would other parameters make stale?

    The copy has links to what is in DVC's cache, without which DVC would call outputs stale, and
    keeps what it writes there.

    Args:
        source: The folder whose results count; it need not exist.
        params: The parameters; None are those of `params.yaml` with the overrides.
        overrides: As in `agents.sac.total_steps=60000`.
    """
    with TemporaryDirectory() as parent:
        folder = Path(parent) / "project"
        renew_project(folder)
        if params:
            Checkout(folder).write_params(params)
        presets.override(folder / "params.yaml", overrides, "overrides")
        for name in LINKED:
            if (source / name).exists():
                (folder / name).symlink_to(source / name)
        for name in COPIED:
            if (source / name).exists():
                shutil.copytree(source / name, folder / name)
        if (source / "dvc.lock").exists():
            shutil.copy(source / "dvc.lock", folder)
        cache = Path(parent) / "cache"
        if (source / ".dvc" / "cache").exists():
            shutil.copytree(source / ".dvc" / "cache", cache, copy_function=os.symlink)
        (folder / ".dvc" / "config.local").write_text(
            f"[cache]\n    dir = {cache}\n"
            f"[core]\n    site_cache_dir = {parent}\n    no_scm = true\n",
            encoding="utf-8",
        )
        yield folder


def trained(folder: Path, source: Path, params: Params, name: str) -> tuple[int, bool]:
    """Return how many seeds of an agent a training would find finished, and if it would find any.

    The latter counts those, too, that were stopped, however far they are.

    Args:
        folder: Where its robot is.
        source: Where its checkpoints are.
        params: All parameters.
        name: The agent.
    """
    kept = home(source) / ".checkpoints" / name
    if not any(kept.glob("*/seed-*")):
        return 0, False
    agent, demonstrations = params.agent(name), None
    if agent.learns_from_demonstrations:
        path = Paths(folder).demonstrations(agent.algorithm)
        demonstrations = path.read_bytes() if path.exists() else b""
    world = World(robot.read(folder, agent.robot), params.env)
    own = kept / checkpoint_key(world, params.training, agent, demonstrations)
    found = {int(path.name.split(".")[0].removeprefix("seed-")) for path in own.glob("seed-*")}
    num_finished = sum((own / f"seed-{seed}.finished").exists() for seed in params.seeds)
    return num_finished, not found.isdisjoint(params.seeds)
