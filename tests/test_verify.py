"""Published seeds, retrained from nothing and compared."""

import json
import subprocess
import sys
from pathlib import Path

import committed
import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.params import presets
from scripts import verify

DQN = "results/agents/dqn"
SEEDS = [int(seed) for seed in json.loads(committed.text(f"{DQN}/training.json"))]
IS_SHALLOW = ("git", "-C", str(PROJECT_ROOT), "rev-parse", "--is-shallow-repository")


@pytest.mark.skipif(
    subprocess.run(IS_SHALLOW, capture_output=True).stdout.strip() != b"false",
    reason="the commit that published the results is not here",
)
@pytest.mark.parametrize(
    ("seed", "status", "message"),
    [
        (SEEDS[1], 0, f"random seed {SEEDS[1]}: same bytes as published (commit "),
        (3, 2, f"error: seed: given 3, allowed: {SEEDS[0]}, {SEEDS[1]}, "),
    ],
)
def test_a_published_seed_has_the_same_bytes_here(seed: int, status: int, message: str) -> None:
    command = [sys.executable, "-m", "scripts.verify", "--agent", "random", "--seed", str(seed)]
    done = subprocess.run(command, cwd=PROJECT_ROOT, encoding="utf-8", capture_output=True)
    assert done.returncode == status, done.stderr
    assert message in (done.stderr if status else done.stdout)


def test_imitators_are_verified_with_all_seeds() -> None:
    params = presets.load("families").model_dump()
    assert verify.chosen(params, ["bc"], params["seeds"]) == params
    with pytest.raises(InputError, match="bc: imitates an agent's seeds together, allowed: --all"):
        verify.chosen(params, ["bc"], params["seeds"][:1])
    with pytest.raises(InputError, match="agent: given 'nobody', allowed: "):
        verify.chosen(params, ["nobody"], params["seeds"])


def test_differences_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    first, second, *_, last = SEEDS
    for root in (ours, theirs):
        committed.extract(root, DQN)
    assert verify.compare(theirs, ours, "dqn", first, "abc")
    assert capsys.readouterr().out == f"dqn seed {first}: same bytes as published (commit abc)\n"
    paths = Paths(ours).agent("dqn")
    digest = verify.digests(paths, first)["policy.zip"]
    training = paths.training.read_text(encoding="utf-8")
    paths.training.write_text(training.replace(digest, "0" * 64), encoding="utf-8")
    assert verify.compare(theirs, ours, "dqn", second, "abc")
    assert not verify.compare(theirs, ours, "dqn", first, "abc")
    assert f"dqn seed {first}: policy.zip differ from what is" in capsys.readouterr().out
    lines = paths.episodes.read_text(encoding="utf-8").splitlines(keepends=True)
    paths.episodes.write_text("".join(lines[:-1]), encoding="utf-8")
    assert not verify.compare(theirs, ours, "dqn", last, "abc")
    assert "episodes.csv differ" in capsys.readouterr().out
    for path in (paths.training, paths.episodes):
        path.write_text("[\n", encoding="utf-8")
        with pytest.raises(InputError, match=f"{path.name}: .*; run `dvc repro --force"):
            verify.compare(theirs, ours, "dqn", first, "abc")
        path.write_text(training, encoding="utf-8")
