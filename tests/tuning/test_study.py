"""Real studies of a small agent: killed and resumed, side by side, and their control."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import optuna
import pytest
from small_study import RANGES, project, records, small_params

from jumping_ant.base import process
from jumping_ant.base.errors import InputError, StoppedError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from jumping_ant.tuning import search, space, study, tune
from jumping_ant.tuning.study import SamplerName

if TYPE_CHECKING:
    from soak.postgres import Postgres

PARAMETERS = 3  # place in a record


@pytest.fixture(autouse=True, scope="module")
def small_ranges() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setitem(space.RANGES, "pgpe", RANGES)
        yield


@pytest.fixture(scope="module")
def whole(small_ranges: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with a finished study, whose last two of twelve trials follow from the others.

    Until the sampler learns, draws depend on the trial's number alone.
    """
    root = project(tmp_path_factory.mktemp("whole"))
    run(root, 12)
    return root


def run(root: Path, trials: int, sampler: SamplerName = "tpe", **more: Any) -> list[str]:
    said: list[str] = []
    tune.run(root, small_params(trials, **more), "pgpe", sampler, say=said.append)
    return said


def start(root: Path, trials: int, *storage: str) -> "subprocess.Popen[str]":
    command = [sys.executable, str(Path(__file__).with_name("small_study.py")), str(root)]
    arguments = [str(trials), *storage]
    return subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, encoding="utf-8")


def kill(root: Path, trials: int, after: str) -> None:
    """Run a study in a process of its own, and kill it when it says something."""
    with start(root, trials) as driver:
        assert driver.stdout
        while not driver.stdout.readline().startswith(after):
            assert driver.poll() is None
        os.kill(driver.pid, signal.SIGKILL)


def database(root: Path, sampler: SamplerName = "tpe") -> Path:
    return Paths(root).study("pgpe", sampler == "random").study


def table(root: Path, sampler: SamplerName = "tpe") -> list[dict[str, str]]:
    text = Paths(root).study("pgpe", sampler == "random").trials.read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def test_a_killed_study_ends_with_the_trials_of_one_that_was_not(
    whole: Path, tmp_path: Path
) -> None:
    """And so does its verdict."""
    torn = project(tmp_path)
    kill(torn, 12, "trial 10")
    before = records(database(torn))
    finished = [row for row in before if row[1] in ("COMPLETE", "PRUNED")]
    assert len(finished) < 12, "it was killed in the middle of one"
    kill(torn, 12, "fresh seed 1, after")
    after = records(database(torn))
    assert [number for number, *_ in after] == list(range(12))
    assert after[: len(finished)] == finished, "what had ended is left alone"
    said = run(torn, 12)
    assert not any(line.startswith(("trial", "fresh seed 1")) for line in said), "nothing twice"
    assert records(database(torn)) == after == records(database(whole))
    for root in (whole, torn):
        assert len(table(root)) == 12
    one, other = (
        json.loads(Paths(root).study("pgpe").summary.read_text(encoding="utf-8"))
        for root in (whole, torn)
    )
    assert one | {"seconds": 0} == other | {"seconds": 0}


def test_a_trial_that_was_running_keeps_its_number_and_its_seeds(
    whole: Path, tmp_path: Path
) -> None:
    root = project(tmp_path)
    run(root, 1)
    (own,) = records(database(root))
    params = small_params(2)
    task = tune.task_of(root, params, "pgpe")
    address = f"{study.FILE}{database(root)}"
    with study.opened(address, tune.study_name(task, "tpe"), "tpe", 0.01, None) as opened:
        study.begin(opened, {})  # ended before anything was drawn
    running = records(database(root))
    assert running[0] == own and running[1][1 : PARAMETERS + 1] == ("RUNNING", None, None)
    said = run(root, 2)
    assert "trial 1 resumes at seed 1" in said
    assert records(database(root)) == records(database(whole))[:2]


@pytest.mark.parametrize("num_ended", [0, 12], ids=["one by one", "together"])
def test_a_trial_killed_while_its_settings_were_drawn_gets_the_same(
    tmp_path: Path, num_ended: int
) -> None:
    """Those of ten trials are drawn one by one, those of later ones together."""
    distributions = space.space_of("sac", params_file.load().agents["sac"]).distributions
    drawn: list[list[dict[str, Any]]] = []
    for file, num_drawn in (("whole", len(distributions)), ("torn", 5)):
        address = f"{study.FILE}{tmp_path}/{file}.db"
        with study.opened(address, "same", "tpe", 0.01, None) as opened:
            for number in range(num_ended):
                opened.tell(study.begin(opened, distributions), float(number % 5))
            study.begin(opened, dict(list(distributions.items())[:num_drawn]))
        with study.opened(address, "same", "tpe", 0.01, None) as opened:
            study.abandoned(opened, address, distributions)
            drawn.append([trial.params for trial in opened.trials])
    assert drawn[0] == drawn[1]
    assert len(drawn[0][-1]) == len(distributions) > 5


def test_trials_side_by_side_are_all_run_once(whole: Path, tmp_path: Path) -> None:
    root = project(tmp_path)
    run(root, 5, workers=2)
    found = records(database(root))
    assert [number for number, *_ in found] == list(range(5))
    assert {state for _, state, *_ in found} <= {"COMPLETE", "PRUNED"}
    first = records(database(whole))[:5]
    assert [row[PARAMETERS] for row in found] == [row[PARAMETERS] for row in first]
    returns, expected = (
        {row["trial"]: row["returns"].split()[0] for row in table(own)} for own in (root, whole)
    )
    assert len(returns) == 5 and returns.items() < expected.items()


def test_the_control_draws_at_random_and_judges_nothing(whole: Path, tmp_path: Path) -> None:
    root = shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    run(root, 12, sampler="random")
    learned, drawn = (records(database(root, sampler)) for sampler in ("tpe", "random"))
    assert drawn[0][PARAMETERS] == learned[0][PARAMETERS], "the agent's own settings"
    assert drawn[11][PARAMETERS] != learned[11][PARAMETERS]
    paths = Paths(root).study("pgpe", is_control=True)
    found = json.loads(paths.summary.read_text(encoding="utf-8"))
    assert "verdict" not in found and found["expected_best"].keys() == {"1", "7"}
    values = [float(row["value"]) for row in table(root, "random")[1:]]
    assert found["expected_best"]["1"] == pytest.approx(sum(values) / 11, abs=0.1)
    run(root, 12)  # now with the control on its page
    page = Paths(root).study("pgpe").page
    assert "random draws, expected best" in page.read_text(encoding="utf-8")
    for others in ({"ranges": {}}, {"task": "0badcafe"}):
        of_others = found | {"rules": found["rules"] | others}
        paths.summary.write_text(json.dumps(of_others), encoding="utf-8")
        told = "\n".join(run(root, 12))
        assert "results/tuning/pgpe-random.json is of another task, ranges or rules" in told
        assert "random draws, expected best" not in page.read_text(encoding="utf-8")


def test_other_settings_begin_another_study(tmp_path: Path) -> None:
    root = project(tmp_path)
    run(root, 1)
    run(root, 1, spread_penalty=0.0)
    run(root, 2)
    assert [number for number, *_ in records(database(root))] == [0, 0, 1]


def test_results_of_another_task_are_told_before_they_are_replaced(tmp_path: Path) -> None:
    """As those of the same agent in another preset; the rules of a search may change."""
    root, params = project(tmp_path), small_params(1)
    run(root, 1)
    others = {
        "env": params.env.model_copy(update={"max_episode_steps": 30}),
        "training": params.training.model_copy(update={"evaluations": 3}),
        "agents": {"pgpe": params.agents["pgpe"].model_copy(update={"generations": 3})},
        "robot": params.robot.model_copy(update={"gear": 200.0}),
    }
    tasks = [params, *(params.model_copy(update={name: own}) for name, own in others.items())]
    assert len({tune.task_of(root, task, "pgpe").digest for task in tasks}) == len(tasks)
    first: list[str] = []
    tune.run(root, tasks[-1], "pgpe", say=first.append)
    assert "pgpe.json is of another robot, reward, budget or settings" in first[0]
    again: list[str] = []
    tune.run(root, tasks[-1], "pgpe", say=again.append)
    assert "of another" not in again[0]


def test_other_libraries_begin_another_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = tune.task_of(tmp_path, small_params(1), "pgpe")
    own = tune.study_name(task, "tpe")
    newer = tmp_path / "requirements.lock"
    newer.write_text(tune.LOCK.read_text(encoding="utf-8") + "more==1.0\n", encoding="utf-8")
    monkeypatch.setattr(tune, "LOCK", newer)
    assert tune.study_name(task, "tpe") != own


def test_a_study_in_a_file_has_one_process(tmp_path: Path) -> None:
    root = project(tmp_path)
    with start(root, 500) as driver:
        assert driver.stdout
        while not driver.stdout.readline().startswith("trial 0"):
            assert driver.poll() is None
        with pytest.raises(InputError, match="given a study that another process uses"):
            run(root, 1)
        driver.send_signal(signal.SIGTERM)
        assert driver.wait(60) == 130
    assert records(database(root))[0][1] == "COMPLETE"


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("postgresql+nothing://me:sec@ret@host/db", "given postgresql+nothing://host/db: "),
        ("me:sec@ret", "given no address, allowed: sqlite:///FILE, postgresql://USER@HOST/NAME"),
        (
            "postgresql://me:sec@ret@host:54x2/db",
            "given postgresql://host:54x2/db, allowed: sqlite",
        ),
        (
            "oracle+oracledb://me:sec@ret@host",
            "its driver is not installed; run: pip install oracledb",
        ),
        ("redis://me:sec@ret@host", "given redis://host: NoSuchModuleError"),
        ("postgresql://me:sec ret@127.0.0.1:1/db", "given postgresql://127.0.0.1:1/db: "),
        ("postgresql://me:sec@ret@127.0.0.1:1/db", "given postgresql://127.0.0.1:1/db: "),
        ("postgresql://127.0.0.1:1/db?user=me&password=sec@ret", "given postgresql://...: "),
        ("postgresql://127.0.0.1:1/db?user=me&password=sec", "given postgresql://127.0.0.1:1/db: "),
    ],
)
def test_storages_that_cannot_be_used_are_told_without_passwords(address: str, told: str) -> None:
    if address.startswith("postgresql://"):
        pytest.importorskip("psycopg", reason="no driver of PostgreSQL: make shared")
    with (
        pytest.raises(InputError, match=re.escape(f"storage: {told}")) as caught,
        study.opened(address, "test", "tpe", 0.01, None),
    ):
        pass
    assert not re.search("sec(?!onds)|ret@", str(caught.value))


def test_a_file_that_is_no_database_is_told(tmp_path: Path) -> None:
    root, params = project(tmp_path), small_params(1)
    path = tmp_path / "torn.db"
    path.write_bytes(b"no database" * 100)
    with pytest.raises(InputError, match="file is not a database"):
        tune.run(root, params, "pgpe", storage=f"sqlite:///{path}", say=lambda _: None)


@pytest.mark.parametrize(
    ("owner", "hours", "is_taken"),
    [
        (process.this_process(), 100.0, False),
        (process.this_process().replace(" ", " 9", 1), 0.0, True),  # a process that is no more
        ("elsewhere 1 a", 5.0, False),
        ("elsewhere 1 a", 7.0, True),
    ],
)
def test_in_a_shared_database_a_trial_is_left_to_a_process_that_lives(
    tmp_path: Path, owner: str, hours: float, is_taken: bool
) -> None:
    address = f"{study.FILE}{tmp_path}/study.db"
    with study.opened(address, "shared", "tpe", 0.01, None) as opened:
        trial = study.begin(opened, {})
        trial.set_user_attr(study.OWNER, owner)
        trial.set_user_attr(study.SIGN, time.time() - 3600 * hours)
        found = study.abandoned(opened, "postgresql://somewhere", {})
        assert [one.number for one in found] == [0] * is_taken
        is_own = opened.trials[0].user_attrs[study.OWNER] == process.this_process()
        assert is_own == (is_taken or owner == process.this_process())


def test_machines_that_share_a_database_run_each_trial_once(
    postgres: "Postgres", whole: Path, tmp_path: Path
) -> None:
    """Two begin at once where nothing is; one is killed in a trial, which the other finishes."""
    root = project(tmp_path)
    storage = postgres.create("trials")
    with start(root, 8, storage) as other:
        said: list[str] = []

        def say(line: str) -> None:
            said.append(line)
            if "trial" in line and other.poll() is None:
                other.kill()

        assert other.stdout
        other.stdout.readline()  # it has opened the study
        params = small_params(8)
        for _ in range(2):  # what the other had begun is known to be abandoned when it is gone
            try:
                tune.run(root, params, "pgpe", storage=storage, say=say)
                break
            except StoppedError as error:
                assert "1 trials run elsewhere" in str(error)
                other.wait()
    (name,) = optuna.get_all_study_names(storage)
    trials = optuna.load_study(study_name=name, storage=storage).trials
    file = f"{study.FILE}{database(whole)}"
    expected = optuna.load_study(study_name=name, storage=file).trials[:8]
    assert [trial.params for trial in trials] == [trial.params for trial in expected]
    assert all(trial.state.is_finished() for trial in trials) and len(trials) == 8
    first = study_returns(trials[0])
    assert first == study_returns(expected[0]) and len(first) == 2


def study_returns(trial: optuna.trial.FrozenTrial) -> list[float]:
    return [own["return"] for own in search.seeds_of(trial)]


def test_a_search_goes_on_after_a_restart_of_its_database(
    postgres: "Postgres", monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its password is in the environment, as docs/shared.md says."""
    monkeypatch.setenv("PGPASSWORD", postgres.password)
    address = postgres.create("restarts").replace(f":{postgres.password}@", "@")
    with study.opened(address, "test", "tpe", 0.01, None) as opened:
        trial = study.begin(opened, {})
        postgres.stop()
        postgres.start()
        study.give_sign(trial)
        assert study.begin(opened, {}).number == 1


def test_a_database_of_mlflow_is_refused(postgres: "Postgres", tmp_path: Path) -> None:
    """Both call a table `alembic_version`, of which a database has one."""
    root, storage = project(tmp_path), postgres.create("mlflows")
    postgres.query("CREATE TABLE alembic_version (version_num VARCHAR(32))", "mlflows")
    postgres.query("INSERT INTO alembic_version VALUES ('dc11669786a5')", "mlflows")
    with pytest.raises(InputError, match="a database of its own") as caught:
        tune.run(root, small_params(1), "pgpe", storage=storage, say=lambda _: None)
    assert postgres.password not in str(caught.value)
