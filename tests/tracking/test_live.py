"""Live curves: followers in real processes."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tracked_project import (
    HEADER,
    NUM_RUNS,
    SEEDS,
    STEPS,
    curve_lines,
    follow,
    make_whole,
    shown,
    state,
    statuses,
    tracked,
    train,
)

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.tracking import store


def script(*steps: Callable[[], object]) -> Callable[[float], bool]:
    """Return a `has_ended` that does one step a call, and then says that training has ended."""
    todo = list(steps)

    def has_ended(seconds: float) -> bool:
        if todo:
            todo.pop(0)()
        return not todo

    return has_ended


def grow(root: Path, num_rows: int, cut: int = 0) -> None:
    """Write the first rows of a curve, and a part of the next."""
    text = curve_lines(0, STEPS[:num_rows]) + curve_lines(0).splitlines()[-1][:cut]
    write_text(Paths(root).agent("sac").seed(0).curve, text)


def test_training_shows_while_it_runs_and_once_afterwards(bare_project: Path) -> None:
    seen: list[object] = []

    def look() -> None:
        (run,) = shown(bare_project).values()
        seen.append((run.status, {step for _, step, _ in run.metrics}))

    def finish() -> None:
        for seed in SEEDS:
            train(bare_project, "sac", seed)
        assert "in training, left to the process that follows it" in tracked(bare_project)[1]

    steps = (lambda: grow(bare_project, 2, cut=3), look, lambda: grow(bare_project, 3), look)
    follow(bare_project, script(*steps, finish))
    assert seen == [("RUNNING", {100, 200}), ("RUNNING", {100, 200, 300})]
    assert statuses(bare_project) == {"sac-seed-0": "FINISHED", "sac-seed-1": "FINISHED"}
    points = shown(bare_project)["sac-seed-0"].metrics
    assert len(points) == len(set(points)) == 16
    make_whole(bare_project)
    tracked(bare_project)
    run = shown(bare_project)["sac-seed-0"]
    assert [point for point in run.metrics if point[1]] == points and run.tags["live"] == "true"
    assert list(statuses(bare_project).values()) == ["FINISHED"] * NUM_RUNS


def test_a_killed_training_is_marked_and_continued(bare_project: Path) -> None:
    follow(bare_project, script(lambda: grow(bare_project, 3)))
    assert statuses(bare_project) == {"sac-seed-0": "KILLED"}
    # Resumed from a checkpoint, the file is behind what MLflow has seen; then begun anew.
    write_text(Paths(bare_project).agent("sac").seed(0).curve, f"{HEADER}\nsac,0,100,9,9,9,9,9\n")
    steps = (lambda: grow(bare_project, 1), lambda: train(bare_project, "sac", 0))
    follow(bare_project, script(*steps))
    assert statuses(bare_project) == {"sac-seed-0": "FINISHED"}
    assert len(shown(bare_project)["sac-seed-0"].metrics) == 16


def test_the_same_policy_again_leaves_its_run_alone(project: Path) -> None:
    """Whatever another host has left running, as a container that was killed."""
    opened = store.connect(project)
    before = state(project)[0]
    run = opened.create_run("sac-seed-0", store.seed_tags("sac", 0, "sac") | {store.LIVE: "true"})
    opened.client.set_tag(run.info.run_id, store.WRITER, "elsewhere 1 1.00")
    assert tracked(project)[-1].endswith("4 unchanged")
    assert len(shown(project)) == NUM_RUNS, "the other one is gone"
    follow(project, script(lambda: None))
    assert state(project)[0]["metrics"] == before["metrics"], "it was trained before"
    policy = Paths(project).agent("sac").seed(0).policy
    policy.unlink()
    follow(project, script(lambda: None, lambda: train(project, "sac", 0)))
    assert tracked(project)[-1].endswith("4 unchanged")
    assert len(shown(project)) == NUM_RUNS
    assert state(project)[0]["model_versions"] == before["model_versions"]


def test_the_follower_ends_with_the_pipe_and_survives_being_killed(bare_project: Path) -> None:
    command = [sys.executable, "-m", "jumping_ant.tracking", "follow", "sac"]
    command += ["--root", str(bare_project)]

    params = params_file.load(bare_project / "params.yaml").model_dump()
    params["agents"]["sac"]["learning_rate"] = 0.125  # what trains; the file says something else

    def start(*options: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [*command, *options],
            cwd=PROJECT_ROOT,
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
        )
        print(json.dumps(params), file=process.stdin, flush=True)
        return process

    grow(bare_project, 2)
    early = start("--after", "600")
    assert early.communicate(timeout=60)[1] == "" and early.returncode == 0
    assert statuses(bare_project) == {}, "too short a training to follow"
    first = start()
    while [len(run.metrics) for run in shown(bare_project).values()] != [7]:
        assert first.poll() is None
        time.sleep(0.1)
    first.send_signal(signal.SIGINT)  # Ctrl-C reaches the whole group; the pipe is what counts
    first.kill()
    first.communicate()
    assert statuses(bare_project) == {"sac-seed-0": "RUNNING"}
    tracked(bare_project)  # which closes what a dead process left
    assert statuses(bare_project) == {"sac-seed-0": "KILLED"}
    second = start()
    train(bare_project, "sac", 0)
    assert second.communicate(timeout=60)[1] == ""  # closes the pipe
    assert second.returncode == 0
    assert statuses(bare_project) == {"sac-seed-0": "FINISHED"}
    run = shown(bare_project)["sac-seed-0"]
    assert (len(run.metrics), run.params["learning_rate"]) == (16, "0.125")
