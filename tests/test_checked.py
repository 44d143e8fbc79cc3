"""What `params.yaml` says reaches no shell and no file before it is checked."""

from collections.abc import Iterator
from typing import Any

import pytest
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import Checkout, copy_project

MARK = "RAN"  # a file that is there once a shell has run what a name holds
INJECTION = f"x;touch {MARK};true"
ENTRIES: dict[str, Any] = {
    "agents": {"algorithm": "random", "robot": "edited"},
    "demonstrations": {"agent": "random", "steps": 100, "seed": 6_000_000},
}
REFUSED = "params.yaml: {block}.{name}: "
IGNORED = " is ignored by .dvcignore"  # DVC removes outputs before a stage runs, but not these
COMMANDS = [  # block, name, command, error
    # With and without the stages before, and so `check`.
    ("agents", INJECTION, "repro --force train@{name}", REFUSED),
    ("agents", INJECTION, "repro --single-item train@{name}", REFUSED),
    ("demonstrations", INJECTION, "repro --downstream demonstrate@{name}", REFUSED),
    *(
        ("agents", name, "repro --single-item train@{name}", "timing/{name}/timing.csv'" + IGNORED)
        for name in ("../docs", ".", "sac/../../docs")
    ),
    ("demonstrations", "../docs", "repro --single-item demonstrate@{name}", ".zip'" + IGNORED),
    ("agents", "../docs", "checkout --force", IGNORED),
]
EXPERIMENTS = [  # name, options, error
    (f"x|touch {MARK}|true", (), "params.yaml: agents.x|touch"),  # DVC allows no `;` here
    ("../docs", ("--temp",), IGNORED),
    ("../../../x", (), "params.yaml: agents.../../../x: String should"),  # DVC removes nothing
]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    """A project whose code is digested and whose robot is built, so that `train` comes next."""
    project = Checkout(tmp_path_factory.mktemp("checkout") / "project")
    copy_project(project.folder)
    (project.folder / "dvc.lock").unlink()  # DVC reads and writes all of it after each stage
    project.seconds("git", "add", "-A")
    project.seconds("git", "commit", "-qm", "Start")
    project.seconds("dvc", "repro", "build")
    return project


@pytest.fixture
def project(built: Checkout) -> Iterator[Checkout]:
    """The same, with its parameters and documents as they were afterwards."""
    yield built
    built.seconds("git", "checkout", "-q", "--", "params.yaml", "docs")
    (built.folder / MARK).unlink(missing_ok=True)


def refusal(project: Checkout, *command: str) -> str:
    """Run a command that must fail without running or removing anything; return its output."""
    done = project.run("dvc", *command)
    printed = done.stdout + done.stderr
    assert done.returncode != 0 and "Traceback" not in printed, printed
    assert not list(project.folder.rglob(MARK)), printed
    assert (project.folder / "docs" / "results.md").is_file(), printed
    return printed


@pytest.mark.parametrize(("block", "name", "command", "error"), COMMANDS)
def test_a_name_reaches_no_shell_and_no_other_folder(
    project: Checkout, block: str, name: str, command: str, error: str
) -> None:
    path = project.folder / "params.yaml"
    params = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    params[block][name] = ENTRIES[block]
    project.write_params(params)
    # What the stages depend on, as if the check had run.
    code = f".inputs/code/train-{name.replace('/', '')}.json"
    for dependency in (".inputs/checked", "models/random", code):
        (project.folder / dependency).write_text("{}", encoding="utf-8")
    printed = refusal(project, *(word.format(name=name) for word in command.split()))
    assert error.format(block=block, name=name) in printed


def test_no_command_holds_a_name() -> None:
    pipeline = YAML(typ="safe").load((PROJECT_ROOT / "dvc.yaml").read_text(encoding="utf-8"))
    for stage in pipeline["stages"].values():
        assert "$" not in stage.get("do", stage)["cmd"]


@pytest.mark.parametrize(("name", "options", "error"), EXPERIMENTS)
def test_overrides_of_an_experiment_are_checked_first(
    project: Checkout, name: str, options: tuple[str, ...], error: str
) -> None:
    override = f"+agents={{{name}:{{algorithm:random,robot:edited}}}}"
    assert error in refusal(project, "exp", "run", *options, "-S", override)
