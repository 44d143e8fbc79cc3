"""The pipeline as a person runs it: a clone, a preset, `dvc`, and the real thing throughout."""

import html
import json
import shlex
import shutil
import subprocess
import sys
from functools import reduce
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import mlflow
import pytest
from mlflow.entities import Run, ViewType
from ruamel.yaml import YAML

from jumping_ant.experiment import presets
from scripts.checkout import copy_project, with_tools

ROOT = Path(__file__).resolve().parents[1]
AGENTS = list(presets.load("smoke").agents)
ONE_WORKER = {"workers": 1, "checkpoint_seconds": 30}
# Stages whose files hold no measured times: all trainings; of the stages that treat all agents
# alike, those of one that gives commands and of one that gives torques.
UNTIMED = [
    *("digest", "build", "lineup"),
    *(f"train@{agent}" for agent in AGENTS),
    *(f"{stage}@{agent}" for stage in ("evaluate", "record") for agent in ("dqn", "sac")),
]


class Project:
    """A clone of the project, with commands run in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.uri = f"sqlite:///{folder}/mlflow.db"
        self._env = with_tools() | {"GIT_CONFIG_GLOBAL": "/dev/null"}
        self._env.pop("MLFLOW_TRACKING_URI", None)

    def run(self, *command: str, check: bool = True) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            command, cwd=self.folder, env=self._env, encoding="utf-8", capture_output=True
        )
        if check and done.returncode:
            raise AssertionError(f"{shlex.join(command)}\n{done.stdout}\n{done.stderr}")
        return done

    def stale(self) -> set[str]:
        """Return the stages that a `dvc repro` would look at again."""
        return set(json.loads(self.run("dvc", "status", "--json").stdout))

    def runs(self) -> list[Run]:
        client = mlflow.MlflowClient(self.uri)
        experiments = [e.experiment_id for e in client.search_experiments()]
        return list(client.search_runs(experiments, run_view_type=ViewType.ACTIVE_ONLY))


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("clone") / "project"
    copy_project(folder)
    project = Project(folder)
    project.run("git", "config", "user.name", "Test")
    project.run("git", "config", "user.email", "test@example.org")
    project.run("git", "add", "-A")
    project.run("git", "commit", "-qm", "Start")
    project.run(
        "dvc", "exp", "run", *shlex.split((ROOT / "presets" / "smoke").read_text(encoding="utf-8"))
    )
    return project


def test_everything_is_there_and_up_to_date(project: Project) -> None:
    for agent in AGENTS:
        for seed in (0, 1):
            folder = project.folder / "models" / agent / f"seed-{seed}"
            assert (folder / "policy.zip").is_file() and (folder / "final.zip").is_file()
        frames = iio.imread(project.folder / "media" / f"{agent}.mp4")
        assert frames.shape[1:] == (120, 160, 3)
        assert frames.std() > 5 and (frames[0] != frames[-1]).any()
        assert (project.folder / "media" / f"{agent}.rrd").stat().st_size > 10_000
    comparison = json.loads(
        (project.folder / "results" / "comparison.json").read_text(encoding="utf-8")
    )
    assert list(comparison["agents"]) == AGENTS
    for figures in comparison["agents"].values():
        assert figures["seeds"] == 2
        low, iqm, high = (figures["return"][name] for name in ("low", "iqm", "high"))
        assert low <= iqm <= high
    page = (project.folder / "results" / "report.html").read_text(encoding="utf-8")
    assert all(claim["text"] in html.unescape(page) for claim in comparison["claims"])
    assert project.stale() == set()
    assert "Data and pipelines are up to date." in project.run("dvc", "repro").stdout


def digests(project: Project) -> dict[str, str]:
    """Return DVC's digest of every output without wall-clock times in it, but for recordings."""
    stages = YAML(typ="safe").load((project.folder / "dvc.lock").read_text(encoding="utf-8"))[
        "stages"
    ]
    timed = ("timing.csv", "scaling.csv", "comparison.json", "figures", "plots", "report.html")
    return {
        out["path"]: out["md5"]
        for stage in stages.values()
        for out in stage.get("outs", [])
        if not out["path"].endswith((*timed, ".rrd"))
    }


def test_a_forced_rerun_on_one_worker_changes_no_byte(project: Project, tmp_path: Path) -> None:
    before = digests(project)
    params = project.folder / "params.yaml"
    text = params.read_text(encoding="utf-8")
    with params.open("w", encoding="utf-8") as file:
        YAML().dump(YAML(typ="safe").load(text) | {"compute": ONE_WORKER}, file)
    assert len(before) > 5 * len(AGENTS)
    recordings = ["dqn.rrd", "sac.rrd", "lineup.rrd"]
    for name in recordings:
        shutil.copy(project.folder / "media" / name, tmp_path)
    done = project.run("dvc", "repro", "--force", "--single-item", *UNTIMED)
    assert "sac seed 1: done, 600 steps" in done.stderr
    assert "trained before" not in done.stderr
    params.write_text(text, encoding="utf-8")
    assert digests(project) == before
    for name in recordings:
        new = project.folder / "media" / name
        project.run("rerun", "rrd", "compare", str(tmp_path / name), str(new))


LITTER = [".page.html.swp", "page.html~", "#page.html#", "4913", ".DS_Store", "._trainer.py"]
FOLDERS = [
    *("jumping_ant/agents/evolution", "jumping_ant/showing/report", "stages", "robots", "assets"),
    *("models/sac", "models/sac/seed-0", "media", "results/agents/sac", "results/figures"),
    *("digests", "trainers/evolution"),
]


def test_what_editors_and_systems_leave_reruns_nothing(project: Project) -> None:
    stale = project.stale()  # the forced rerun measured new times
    left = [project.folder / folder / name for folder in FOLDERS for name in LITTER]
    locks = [project.folder / folder / ".#trainer.py" for folder in FOLDERS]
    for path in left:
        path.write_bytes(b"\0not Python")
    for path in locks:
        path.symlink_to("somebody@nowhere")  # Emacs's lock leads to no file
    assert project.stale() == stale
    project.run(sys.executable, "-m", "stages.digest")
    assert project.stale() == stale
    for path in left + locks:
        path.unlink()


def test_git_knows_only_small_things(project: Project) -> None:
    changed = project.run("git", "status", "--porcelain", "--untracked-files=all").stdout
    for line in changed.splitlines():
        path = project.folder / line[3:]
        assert path.stat().st_size < 300_000, line  # dvc.lock grows with the agents
        assert path.suffix not in {".mp4", ".rrd", ".zip", ".npz", ".db"}, line


def test_metrics_and_plots_are_shown(project: Project) -> None:
    metrics = json.loads(project.run("dvc", "metrics", "show", "--json").stdout)[""]["data"]
    assert {f"results/agents/{agent}/metrics.json" for agent in AGENTS} <= set(metrics)
    plots = json.loads(project.run("dvc", "plots", "show", "--json").stdout)
    assert plots["data"] and not plots.get("errors")


def test_mlflow_mirrors_the_files(project: Project) -> None:
    runs = project.runs()
    parents = [run for run in runs if "mlflow.parentRunId" not in run.data.tags]
    assert len(parents) == 1
    children = {run.info.run_name: run for run in runs if run not in parents}
    assert set(children) == {f"{agent}-seed-{seed}" for agent in AGENTS for seed in (0, 1)}
    for run in children.values():
        assert run.data.tags["mlflow.parentRunId"] == parents[0].info.run_id
        assert run.info.status == "FINISHED"
    project.run(sys.executable, "-m", "stages.track")
    assert len(project.runs()) == len(runs), "tracking again adds nothing"


def test_a_new_seed_trains_alone(project: Project) -> None:
    before = digests(project)
    path = project.folder / "params.yaml"
    text = path.read_text(encoding="utf-8")
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(YAML(typ="safe").load(text) | {"seeds": [0, 1, 2]}, file)
    done = project.run("dvc", "repro", "--single-item", "train@pgpe")
    assert {line for line in done.stderr.splitlines() if "trained before" in line} == {
        f"pgpe: seed {seed}: trained before, 1,600 steps" for seed in (0, 1)
    }
    assert "pgpe seed 2: done" in done.stderr
    path.write_text(text, encoding="utf-8")
    project.run("dvc", "repro", "--single-item", "train@pgpe")
    assert digests(project) == before


def test_changed_code_reruns_what_runs_it(project: Project) -> None:
    module = project.folder / "jumping_ant" / "agents" / "evolution" / "trainer.py"
    before, stale = (
        module.read_text(encoding="utf-8"),
        project.stale(),
    )  # the forced rerun measured new times
    module.write_text(before + "\n# A comment.\n", encoding="utf-8")
    assert project.stale() - stale == {"digest"}
    project.run("dvc", "repro", "digest")
    assert project.stale() - stale == {"train@pgpe"}
    module.write_text(before, encoding="utf-8")
    project.run("dvc", "repro", "digest")
    assert project.stale() == stale <= {"lineup", "compare", "report", "track"}


def test_a_changed_number_reruns_what_it_touches(project: Project) -> None:
    project.run("git", "add", "-A")
    project.run("git", "commit", "-qm", "Before the change")
    change = ("-S", "agents.sac.learning_rate=0.002", "-S", "compute.workers=1")
    done = project.run("dvc", "exp", "run", *change, "evaluate@sac")
    ran = {line.split("'")[1] for line in done.stdout.splitlines() if "Running stage" in line}
    assert ran == {"check", "train@sac", "evaluate@sac"}
    assert project.stale() == {"record@sac", "scaling@sac", "lineup", "compare", "report", "track"}


def test_a_change_is_told_readably(project: Project) -> None:
    """After the change above, before it is committed."""
    told = project.run("dvc", "params", "diff", "--md").stdout
    before = presets.load("smoke").agent("sac").model_dump()["learning_rate"]
    row = f"| params.yaml | agents.sac.learning_rate | {before} | 0.002 |"
    assert row in " ".join(told.split())
    metrics = json.loads(project.run("dvc", "metrics", "diff", "--json").stdout)
    assert set(metrics) == {"results/agents/sac/metrics.json"}
    shown = project.run("dvc", "exp", "show", "--only-changed", "--csv").stdout.splitlines()
    columns = shown[0].split(",")
    assert {"agents.sac.learning_rate", "results/agents/sac/metrics.json:return"} <= set(columns)
    assert not any(column.startswith(("agents.dqn", "results/agents/dqn")) for column in columns)
    project.run("dvc", "plots", "diff", "--out", "diff")
    page = (project.folder / "diff" / "index.html").read_text(encoding="utf-8")
    assert "workspace" in page and "HEAD" in page
    shutil.rmtree(project.folder / "diff")


@pytest.mark.parametrize(
    ("key", "value", "line"),
    [
        ("agents.sac.learning_rte", 0.1, "agents.sac.learning_rte: unknown key"),
        ("seeds", [1, 1], "seeds holds 1 more than once"),
    ],
)
def test_bad_input_ends_before_any_training(
    project: Project, key: str, value: Any, line: str
) -> None:
    path = project.folder / "params.yaml"
    before, lock = (
        path.read_text(encoding="utf-8"),
        (project.folder / "dvc.lock").read_text(encoding="utf-8"),
    )
    settings = YAML(typ="safe").load(before)
    *parents, last = key.split(".")
    reduce(lambda block, name: block[name], parents, settings)[last] = value
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(settings, file)
    done = project.run("dvc", "repro", check=False)
    path.write_text(before, encoding="utf-8")
    assert done.returncode != 0
    assert line in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert (project.folder / "dvc.lock").read_text(encoding="utf-8") == lock


@pytest.mark.parametrize("stage", ["train", "evaluate", "record"])
def test_an_unknown_agent_is_refused(project: Project, stage: str) -> None:
    done = project.run(sys.executable, "-m", f"stages.{stage}", "nobody", check=False)
    assert done.returncode == 2
    assert f"given 'nobody', allowed: {', '.join(AGENTS)}" in done.stderr
    assert "Traceback" not in done.stderr
