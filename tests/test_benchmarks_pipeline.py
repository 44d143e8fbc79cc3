"""What the benchmarks of the whole pipeline rest on: watching commands, and shortened runs."""

import os
import sys
from pathlib import Path

import pytest

from benchmarks.full_run import summarize
from benchmarks.pipeline import TRANSITION_BYTES, empty_replay_memory, shortened
from benchmarks.watch import Usage, watch
from jumping_ant.params.model import Params

HOLD = "import os, time; held = b'x' * 2**28; {}; time.sleep(1)"
PROCESSES = {
    "itself": HOLD.format("pass"),
    "pages shared by two": HOLD.format("os.fork()"),
    "a child without variables": "import subprocess, sys; "
    f"subprocess.run([sys.executable, '-c', {HOLD.format('pass')!r}], env={{}})",
}


@pytest.mark.parametrize("code", PROCESSES.values(), ids=PROCESSES.keys())
def test_watching_sums_memory(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.watch.SECONDS_BETWEEN_SAMPLES", 0.2)
    usage = watch([sys.executable, "-c", code], tmp_path, os.environ)
    assert 0.25 < usage.peak_memory < 0.3
    assert 0 < usage.peak_seconds < usage.seconds


def test_a_watched_command_that_fails_says_why(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="no such luck"):
        watch([sys.executable, "-c", "raise SystemExit('no such luck')"], tmp_path, os.environ)


def test_a_stage_lasts_until_the_next_begins() -> None:
    lines = [
        (1.0, "Running stage 'build':"),
        (1.0, "> python -m stages.build"),
        (3.0, "Stage 'train@random' didn't change, skipping"),
        (3.5, "Running stage 'train@sac':"),
    ]
    assert summarize(Usage(10.0, lines, peak_memory=1.234, peak_seconds=4.0)) == {
        "stages": {"build": 2.5, "train@sac": 6.5},
        "seconds": 10.0,
        "peak_memory_gib": 1.23,
        "peak_stage": "train@sac",
    }


def test_a_shortened_run_keeps_all_but_the_budgets(known_params: Params) -> None:
    dqn, pgpe = known_params.agent("dqn"), known_params.agent("pgpe")
    agents = {
        "dqn": dqn.model_copy(update={"total_steps": 120_000}),
        "pgpe": pgpe.model_copy(update={"generations": 110}),
    }
    params = known_params.model_copy(update={"agents": agents})
    brief = shortened(params, {"total_steps": 0.1, "generations": 0.01})
    assert brief.agent("dqn") == dqn.model_copy(update={"total_steps": 12_000})
    assert brief.agent("pgpe") == pgpe.model_copy(update={"generations": 1})
    assert brief.seeds == known_params.seeds


def test_replay_memory_left_empty_is_that_of_every_worker(known_params: Params) -> None:
    dqn = known_params.agent("dqn")
    params = known_params.model_copy(
        update={
            "seeds": [0, 1, 2],
            "agents": {"dqn": dqn.model_copy(update={"total_steps": 1000, "buffer_size": 800})},
            "compute": known_params.compute.model_copy(update={"workers": 2}),
        }
    )
    transition = TRANSITION_BYTES / 2**30
    assert empty_replay_memory(params, share=0.1) == pytest.approx(2 * 700 * transition)
    assert empty_replay_memory(params, share=0.9) == 0
