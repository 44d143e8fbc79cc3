"""The command line of `make tune`."""

from pathlib import Path
from typing import Any

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.tracking import studies
from scripts import tune


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """The calls of the search, which is not run, and of the mirror."""
    calls: list[tuple[Any, ...]] = []
    monkeypatch.setattr(tune.tune, "run", lambda *given: calls.append(given))
    monkeypatch.setattr(studies, "track", lambda root, say: calls.append((root,)))
    return calls


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr("sys.argv", ["tune", *words])
    tune.main()


def test_what_is_given_replaces_what_the_parameters_say(
    monkeypatch: pytest.MonkeyPatch, called: list[tuple[Any, ...]]
) -> None:
    own = params_file.load()
    run(monkeypatch, "sac", "--trials", "7", "--sampler", "random", "--storage", "sqlite:///a.db")
    (root, params, *others), mirrored = called
    assert params.tuning == own.tuning.model_copy(update={"trials": 7})
    assert [root, *others] == [PROJECT_ROOT, "sac", "random", "sqlite:///a.db"]
    assert mirrored == (PROJECT_ROOT,)
    called.clear()
    run(monkeypatch, "td3", "--preset", "families")
    assert "td3" in called[0][1].agents and called[0][1].tuning == own.tuning
    assert called[0][2:] == ("td3", "tpe", None)


@pytest.mark.parametrize("given", ["0", "-3", "many", "1.5"])
def test_a_number_of_trials_is_a_whole_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], given: str
) -> None:
    with pytest.raises(SystemExit):
        run(monkeypatch, "sac", f"--trials={given}")
    assert f"--trials: given '{given}', allowed: 1 or more" in capsys.readouterr().err


def test_without_mlflow_the_files_are_there_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
    called: list[tuple[Any, ...]],
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(root: Path, say: object) -> None:
        raise InputError("MLflow at http://nowhere: cannot be reached")

    monkeypatch.setattr(studies, "track", fail)
    run(monkeypatch, "sac")
    assert len(called) == 1
    assert "warning: MLflow at http://nowhere: cannot be reached" in capsys.readouterr().err
