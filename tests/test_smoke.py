"""The pipeline as a person runs it: a clone, a preset, `dvc`, and the real thing throughout."""

import html
import json
import os
import re
import signal
import sys
import time
from pathlib import Path

import imageio.v3 as iio
import mlflow
from finished_project import BACK, COMMIT, Project
from mlflow.entities import Run
from rerun.chunk import RrdReader
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file, presets
from jumping_ant.tracking import store
from scripts.checkout import RESULTS
from soak.project import start

AGENTS = list(presets.load("smoke").agents)
MEASURED = ("results/timing", "results/scaling.csv", "results/speed.json")  # by a clock
COMPUTE = presets.load("smoke").compute.model_dump()
# One agent's stages without measured times, and its training, which keeps them in files apart.
# tests/training/test_driver.py checks that each family of algorithms trains alike in any process,
# tests/report/test_apart.py that tables and pages are the same.
UNTIMED = ("train@sac", "evaluate@sac", "record@sac")
EXPERIMENT = "dvc exp run --name faster -S agents.sac.learning_rate=0.001"
FORTH = "git stash pop && dvc checkout"


def test_everything_is_there_and_up_to_date(project: Project) -> None:
    media, results = project.folder / "media", project.folder / "results"
    for agent in AGENTS:
        for seed in (0, 1):
            folder = project.folder / "models" / agent / f"seed-{seed}"
            assert (folder / "policy.zip").is_file() and (folder / "final.zip").is_file()
        frames = iio.imread(media / f"{agent}.mp4")
        assert frames.shape[1:] == (120, 160, 3)
        assert frames.std() > 5 and (frames[0] != frames[-1]).any()
        assert (media / f"{agent}.rrd").stat().st_size > 10_000
    recordings = list(media.glob("*.rrd"))
    ids = {entry.recording_id for path in recordings for entry in RrdReader(path).recordings()}
    assert len(ids) == len(recordings) == len(AGENTS) + 1, "`make view` opens them together"
    comparison = json.loads((results / "comparison.json").read_text(encoding="utf-8"))
    assert list(comparison["agents"]) == AGENTS
    assert all(figures["seeds"] == 2 for figures in comparison["agents"].values())
    page = (results / "report.html").read_text(encoding="utf-8")
    assert all(claim["text"] in html.unescape(page) for claim in comparison["claims"])
    assert project.stale() == set()
    assert "Data and pipelines are up to date." in project.run("dvc", "repro").stdout


def digests(project: Project) -> dict[str, str]:
    """Return DVC's digest of every output that is not measured."""
    lock = YAML(typ="safe").load((project.folder / "dvc.lock").read_text(encoding="utf-8"))
    outs = [out for stage in lock["stages"].values() for out in stage.get("outs", [])]
    return {
        out["path"]: out["md5"]
        for out in outs
        if not out["path"].startswith(MEASURED) and not out["path"].endswith(".rrd")
    }


def test_a_forced_rerun_on_two_workers_changes_no_byte(project: Project) -> None:
    before = digests(project)
    project.change_params(compute=COMPUTE | {"workers": 2})
    assert len(before) > 5 * len(AGENTS)
    project.run("rm", "-r", ".checkpoints/sac")
    done = project.run("dvc", "repro", "--force", "--single-item", *UNTIMED)
    assert "sac seed 1: done, 600 steps" in done.stderr
    assert digests(project) == before
    project.go_back()


def test_what_editors_and_systems_leave_reruns_nothing(project: Project) -> None:
    folders = [
        *("jumping_ant/agents/evolution", "jumping_ant/report", "stages", "robots", "assets"),
        *("models/sac", "models/sac/seed-0", "media", "results/agents/sac", "results/figures"),
        *(".inputs/code", ".inputs/train/pgpe"),
    ]
    names = [".page.html.swp", "page.html~", "#page.html#", "4913", ".DS_Store", "._trainer.py"]
    names += [".edited.xml.999999.new.tmp"]  # of a write that was killed
    left = [project.folder / folder / name for folder in folders for name in names]
    locks = [project.folder / folder / ".#trainer.py" for folder in folders]
    for path in left:
        path.write_bytes(b"\0not Python")
    for path in locks:
        path.symlink_to("somebody@nowhere")  # Emacs's lock leads to no file
    assert project.stale() == set()
    project.run(sys.executable, "-m", "stages.digest")
    assert project.stale() == set()
    for path in left + locks:
        path.unlink()


def test_git_knows_only_small_things(project: Project) -> None:
    committed = project.run("git", "ls-files", *RESULTS).stdout.splitlines()
    assert "results/agents/sac/episodes.csv" in committed
    assert not [name for name in committed if name.endswith((".mp4", ".rrd", ".zip", ".npz"))]
    # dvc.lock grows with the agents.
    assert max((project.folder / name).stat().st_size for name in committed) < 300_000


def runs(project: Project) -> list[Run]:
    """Return the runs of the comparison's experiment; published searches have another."""
    client = mlflow.MlflowClient(f"sqlite:///{project.folder}/mlflow.db")
    return list(client.search_runs([client.get_experiment_by_name("jumping-ant").experiment_id]))


def test_mlflow_mirrors_the_files_once(project: Project) -> None:
    found = runs(project)
    names = [f"{agent}{end}" for agent in AGENTS for end in ("-seed-0", "-seed-1", ", 2 seeds")]
    children = [run.info.run_name for run in found if "mlflow.parentRunId" in run.data.tags]
    assert sorted(children) == sorted(names) and len(found) == len(names) + 1
    project.run(sys.executable, "-m", "stages.track")
    assert len(runs(project)) == len(found)


def test_a_new_seed_trains_alone_and_shows_live(project: Project) -> None:
    before = project.state().files
    live = COMPUTE | {"workers": 1, "live_after_seconds": 0}
    project.change_params(seeds=[0, 1, 2], compute=live)
    done = project.run("dvc", "repro", "--single-item", "train@pgpe")
    assert {line for line in done.stderr.splitlines() if "trained before" in line} == {
        f"pgpe: seed {seed}: trained before, 1,600 steps" for seed in (0, 1)
    }
    assert "pgpe seed 2: done" in done.stderr
    trained = {name for name in before if name.startswith("models/pgpe/")}
    assert len(trained) == 2 * 4
    assert {(name, before[name]) for name in trained} < project.state().files.items()
    (new,) = (run for run in runs(project) if run.info.run_name == "pgpe-seed-2")
    assert (new.info.status, new.data.tags[store.LIVE]) == ("FINISHED", "true")
    project.go_back()


def test_changed_code_reruns_what_runs_it(project: Project) -> None:
    """A comment reruns nothing, not even in a module that all stages run."""
    changes = {"base/files.py": "# Why.\n", "agents/evolution/trainer.py": "X = 1\n"}
    for name, more in changes.items():
        with (project.folder / "jumping_ant" / name).open("a", encoding="utf-8") as file:
            file.write(more)
    assert project.stale() == {"digest"}
    project.run("dvc", "repro", "digest")
    assert project.stale() == {"train@pgpe"}
    project.go_back()
    assert project.stale() == set()


def test_bad_input_ends_before_any_training(project: Project) -> None:
    """DVC removes the outputs of the stage that refuses it; they come back with the parameters."""
    lock = (project.folder / "dvc.lock").read_bytes()
    agents = params_file.load(project.folder / "params.yaml").model_dump()["agents"]
    agents["sac"]["learning_rte"] = 0.1
    project.change_params(agents=agents)
    done = project.run("dvc", "repro", check=False)
    printed = done.stdout + done.stderr
    assert done.returncode and "agents.sac: unknown key 'learning_rte'" in printed
    assert "Traceback" not in printed
    assert (project.folder / "dvc.lock").read_bytes() == lock
    project.go_back()


def test_an_experiment_comes_and_goes(project: Project) -> None:
    """With an agent more, so that it leaves files where there were none."""
    mine = project.state()
    agents = params_file.load(project.folder / "params.yaml").model_dump()["agents"]
    project.change_params(agents=agents | {"still": agents["random"]})
    # Stages of every kind of output; the others would take longer and show the same.
    project.type(f"{EXPERIMENT} evaluate@sac evaluate@still record@still")
    stale = project.stale()
    assert {"record@sac", "compare", "report", "track"} <= stale
    assert not {name for name in stale if name.endswith(("@random", "@dqn", "@pgpe"))}
    experiment = project.state()
    new = experiment.files.keys() - mine.files.keys()
    assert {name.split("/")[0] for name in new} == {"models", "media", "results"}
    for forth in (FORTH, "dvc exp apply faster"):
        project.go_back()
        assert not project.state().changes(mine)
        assert project.stale() == set()
        project.type(forth)
        assert not project.state().changes(experiment)
    # What changed, as README.md compares it.
    parameters = json.loads(project.type("dvc params diff --json").stdout)["params.yaml"]
    rate = parameters["agents.sac.learning_rate"]
    before = presets.load("smoke").agent("sac").model_dump()["learning_rate"]
    assert (rate["old"], rate["new"]) == (before, 0.001)
    metrics = json.loads(project.type("dvc metrics diff --json").stdout)
    assert set(metrics) == {f"results/agents/{agent}/metrics.json" for agent in ("sac", "still")}
    shown = project.type("dvc exp show --only-changed --csv").stdout
    columns = shown.splitlines()[0].split(",")
    assert {"agents.sac.learning_rate", "results/agents/sac/metrics.json:return"} <= set(columns)
    assert not any(column.startswith(("agents.dqn", "results/agents/dqn")) for column in columns)
    assert "faster" in shown
    project.type("dvc metrics show && dvc plots show && dvc plots diff")
    page = (project.folder / "dvc_plots" / "index.html").read_text(encoding="utf-8")
    assert "workspace" in page and "HEAD" in page
    project.go_back()


def test_who_clones_and_pulls_has_nothing_to_run(project: Project, tmp_path: Path) -> None:
    shared = f"dvc remote add --local --default shared {tmp_path}/remote"
    project.type(f"{shared} && dvc push")
    clone = Project(tmp_path / "clone")
    project.type(f"git clone -q . {clone.folder} && cd {clone.folder} && {shared} && dvc pull")
    assert clone.stale() == set()
    assert not clone.state().files.items() ^ project.state().files.items()


def test_a_run_that_is_not_committed_is_not_lost(project: Project) -> None:
    """The commit before it has outputs that are in nobody's cache."""
    mine = project.state()
    project.run("git", "reset", "--quiet", ":/^Start")
    assert project.type(BACK, check=False).returncode
    assert project.state().changes(mine)
    project.type(FORTH)
    assert not project.state().changes(mine)
    project.type(COMMIT)


def test_a_killed_experiment_is_left(project: Project, tmp_path: Path) -> None:
    log = tmp_path / "log"
    command = ("dvc", "exp", "run", "-S", "agents.sac.total_steps=100000")
    process = start(project, *command, log=log)
    while "'train@sac'" not in log.read_text(encoding="utf-8"):
        assert process.poll() is None, log.read_text(encoding="utf-8")
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert project.run("git", "branch", "--show-current").stdout == ""
    project.type("git switch main")
    project.go_back()
    assert project.stale() == set()


def test_the_viewer_opens_what_is_there(project: Project) -> None:
    """In a browser, as there is no display."""
    done = project.type("timeout 20 python -m scripts.view sac", check=False)
    assert "media/sac.rrd" in done.stdout + done.stderr
    assert "a browser shows it at the last address below" in done.stdout
    refused = project.type("python -m scripts.view nobody", check=False).stderr
    assert "recordings in media/: given 'nobody', allowed: dqn, lineup, " in refused


def test_the_snippets_run(project: Project) -> None:
    """One after the other, as they share what takes long: the imports."""
    readme = (PROJECT_ROOT / "README.md").read_text(encoding="utf-8")
    program = "\n".join(re.findall(r"^```python\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL))
    for text, here in {"seed-30": "seed-0", 'render_mode="human"': "render_mode=None"}.items():
        assert program.count(text) == 1
        program = program.replace(text, here)
    project.run("python", "-c", program)
