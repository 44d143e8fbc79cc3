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


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    """A project whose code is digested and whose robot is built, so that `train` comes next."""
    project = Checkout(tmp_path_factory.mktemp("checkout") / "project")
    copy_project(project.folder)
    (project.folder / "dvc.lock").unlink()  # DVC reads and writes all of it after each stage
    project.seconds("git", "add", "-A")
    author = ("-c", "user.name=Test", "-c", "user.email=test@example.org")
    project.seconds("git", *author, "commit", "-qm", "Start")
    project.seconds("dvc", "repro", "build")
    return project


@pytest.fixture
def project(built: Checkout) -> Iterator[Checkout]:
    """The same, with its parameters and documents as they were afterwards."""
    yield built
    built.seconds("git", "checkout", "-q", "--", "params.yaml", "docs")
    (built.folder / MARK).unlink(missing_ok=True)


def add(project: Checkout, block: str, name: str) -> None:
    """Add an entry to a block of `params.yaml`, which the check has not seen."""
    path = project.folder / "params.yaml"
    params = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    params[block][name] = ENTRIES[block]
    with path.open("w", encoding="utf-8") as file:
        YAML().dump(params, file)
    for dependency in (
        *(".inputs/checked", "models/random"),
        f".inputs/code/train-{name.replace('/', '')}.json",
    ):
        (project.folder / dependency).write_text("{}", encoding="utf-8")


def refusal(project: Checkout, *command: str) -> str:
    """Run a command that must fail without running anything; return its output."""
    done = project.run(*command)
    told = done.stdout + done.stderr
    assert done.returncode != 0, told
    assert "Traceback" not in told
    assert not list(project.folder.rglob(MARK)), told
    assert (project.folder / "docs" / "results.md").is_file(), told
    return told


@pytest.mark.parametrize(
    ("stage", "block", "option"),
    [
        ("train", "agents", "--force"),
        ("train", "agents", "--single-item"),
        ("demonstrate", "demonstrations", "--downstream"),
    ],
)
def test_a_name_reaches_no_shell(project: Checkout, stage: str, block: str, option: str) -> None:
    """Neither as DVC runs all stages nor as it leaves out those before, and so `check`."""
    add(project, block, INJECTION)
    told = refusal(project, "dvc", "repro", option, f"{stage}@{INJECTION}")
    assert f"params.yaml: {block}.{INJECTION}: " in told and f", given '{INJECTION}'" in told


def test_no_command_holds_a_name() -> None:
    stages = YAML(typ="safe").load((PROJECT_ROOT / "dvc.yaml").read_text(encoding="utf-8"))[
        "stages"
    ]
    for stage in stages.values():
        assert "$" not in stage.get("do", stage)["cmd"]


ELSEWHERE = ["../docs", ".", "sac/../../docs"]


@pytest.mark.parametrize("name", ELSEWHERE)
def test_an_agents_name_leads_to_no_other_folder(project: Checkout, name: str) -> None:
    """DVC removes outputs before it runs a stage, and all that it cannot check out."""
    add(project, "agents", name)
    told = refusal(project, "dvc", "repro", "--single-item", f"train@{name}")
    assert f"results/timing/{name}/timing.csv' is ignored by .dvcignore" in told


def test_neither_does_an_algorithms_name_or_one_that_is_checked_out(project: Checkout) -> None:
    add(project, "demonstrations", "../docs")
    told = refusal(project, "dvc", "repro", "--single-item", "demonstrate@../docs")
    assert ".inputs/train/../docs/demonstrations.zip' is ignored by .dvcignore" in told
    add(project, "agents", "../docs")
    assert "is ignored by .dvcignore" in refusal(project, "dvc", "checkout", "--force")


EXPERIMENTS = [
    (f"x|touch {MARK}|true", "params.yaml: agents.x|touch", ()),  # DVC allows no `;` here
    ("../docs", "is ignored by .dvcignore", ("--temp",)),
    # Outside, where DVC removes nothing.
    ("../../../x", "params.yaml: agents.../../../x: String should match", ()),
]


@pytest.mark.parametrize(("name", "said", "options"), EXPERIMENTS)
def test_overrides_of_an_experiment_are_checked_first(
    project: Checkout, name: str, said: str, options: tuple[str, ...]
) -> None:
    override = f"+agents={{{name}:{{algorithm:random,robot:edited}}}}"
    assert said in refusal(project, "dvc", "exp", "run", *options, "-S", override)


def test_a_comment_reruns_the_check_alone(project: Checkout) -> None:
    project.seconds("dvc", "repro", "build")
    with (project.folder / "params.yaml").open("a", encoding="utf-8") as file:
        file.write("# A comment.\n")
    ran = project.run("dvc", "repro", "build").stdout
    assert [line for line in ran.splitlines() if "Running" in line] == ["Running stage 'check':"]
