"""Every command in the documents is run where everything was run before, and nothing gets lost."""

import json
import os
import re
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from finished_project import BACK, COMMIT, RUN, Project

from jumping_ant.experiment import params_file, presets
from soak.project import start

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "benchmarks/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]
TOOLS = ("make", "dvc", "git", "python", "mlflow", "rerun", "pytest", "ruff", "mypy", "source")
NAMES = {"dvc", "mlflow", "rerun", "source"}  # alone they name a tool, or a setting

EXPERIMENT = "dvc exp run --name faster -S agents.sac.learning_rate=0.001"
AGAIN = "dvc exp apply faster"
TARGETS = ("evaluate@sac", "evaluate@still", "record@still")
AFTER_ALL = ("lineup", "compare", "crossings", "overtaking", "speed", "report", "track", "play")
FORTH = "git stash pop && dvc checkout"
ON_BRANCH = "git switch main"
CHANGES = {"dvc params diff", "dvc metrics diff", "dvc exp show --only-changed", "dvc plots diff"}
PUBLISH = "make publish"
TABLES = {  # the preset and the document that has its table
    f"{PUBLISH} PRESET=ablations": ("ablations", "results.md"),
    f"{PUBLISH} PRESET=hopper": ("hopper", "results.md"),
    f"{PUBLISH} PRESET=families": ("families", "families.md"),
}
README = (ROOT / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"^```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
HERE = {"seed-30": "seed-0", 'render_mode="human"': "render_mode=None"}  # for the small project
VIEWS = {"make view AGENT=sac": "sac", "make view AGENT=lineup": "lineup"}

# Commands that the tests named here run, and those that take hours or change the machine.
CHECKS = "a part of `make test`, as this test is"
LONG = ("ablations", "families", "hopper", "replicate", "run", "thesis")
HOURS = "hours of training; tests/test_pipeline.py makes the parameters, presets/smoke runs"
ARTICLE = "hours of training; tests/article/test_article_run.py runs it with less"
MEASURES = "minutes that need the machine for themselves; tests/test_benchmarks.py tests its parts"
SOAK = "half an hour; tests/test_soak.py runs a little of each part"
VERIFY = "minutes of training; tests/test_verify.py verifies another agent"
TUNE = "hours of training; tests/tuning/test_study.py tunes a small agent"
SHARED = "needs servers; tests/tracking/test_postgres.py starts one"
REMOTE = "needs other machines, or hours of training"
COST = "a test below asks for other values; tests/test_cost.py"
GRID = "dvc exp run --queue -S agents.sac.learning_rate=0.0003,0.001,0.003"
CLUSTER = "needs machines; tests/small_ray.py starts a cluster of one"
SERVER_ONCE = (
    "sudo -u postgres createuser --pwprompt robots && "
    "sudo -u postgres createdb --owner robots mlflow"
)
SERVER = (
    "mlflow server --backend-store-uri postgresql://robots@localhost/mlflow "
    "--artifacts-destination /srv/mlflow --host 0.0.0.0"
)
SHARED_SEARCH = "make tune AGENT=sac TRIALS=40 STORAGE=postgresql://robots@SERVER/trials"
S3 = (
    "dvc remote add -d shared s3://BUCKET/robots",
    "dvc remote modify shared endpointurl http://SERVER:8333",
    "dvc remote modify --local shared access_key_id ID",
    "dvc remote modify --local shared secret_access_key KEY",
)
RAY = (
    "export RAY_AUTH_MODE=token RAY_AUTH_TOKEN=TOKEN RAY_USAGE_STATS_ENABLED=0",
    "ray start --head --port 6379 --num-cpus 0 --include-dashboard false",
    "ray start --address HEAD:6379",
    "ray start --address HEAD:6379 --num-cpus 0",
    "RAY_ADDRESS=HEAD:6379 dvc repro",
)
ELSEWHERE = {
    RUN: "tests/finished_project.py",
    COMMIT: "tests/finished_project.py",
    "dvc repro --force": "tests/test_smoke.py, for the stages of one agent",
    "python -m stages.track": "tests/test_smoke.py",
    "make ui": "serves until it is stopped; tests/tracking/test_ui.py",
    "make view": "opens all recordings; the two below open one",
    "make watch": "plays until it is closed; tests/test_watch.py",
    "make watch AGENT=sac": "plays until it is closed; tests/test_watch.py",
    "make test": "runs this test",
    "make test-all": "runs this test",
    "git config --global user.name NAME": "changes the user's settings",
    "make test PYTHON=python3.12": "runs this test",
    "make install TORCH_INDEX=": "downloads gigabytes",
    "make shared": "a part of `make test`",
    SERVER_ONCE: SHARED,
    SERVER: SHARED,
    "export MLFLOW_TRACKING_URI=http://SERVER:5000": SHARED,
    "dvc remote add -d shared ssh://USER@SERVER/srv/robots && dvc push && git push": REMOTE,
    "git clone USER@SERVER:robots.git && cd robots && make install shared && dvc pull": REMOTE,
    "dvc remote modify --local shared keyfile ~/.ssh/id_ed25519": REMOTE,
    **dict.fromkeys(S3, REMOTE),
    **dict.fromkeys((GRID, "dvc queue start --jobs 3", "dvc exp run --temp"), REMOTE),
    **{f"dvc exp {way} origin NAME": REMOTE for way in ("push", "pull")},
    **dict.fromkeys(RAY, CLUSTER),
    "python -m soak.cluster": "a command of an earlier commit",
    SHARED_SEARCH: "hours of training; tests/tuning/test_study.py shares a small one",
    "make lock": "asks package indexes for the newest versions",
    "make check": CHECKS,
    "make verify": VERIFY,
    "make verify ALL=1": VERIFY,
    "make verify AGENT=sac SEED=30": VERIFY,
    "make fingerprint": "tests/test_fingerprint.py",
    "python -m scripts.fingerprint": "tests/test_fingerprint.py",
    "python -m scripts.fingerprint --publish": "writes a document; tests/test_fingerprint.py",
    "make parity": "half an hour of episodes; tests/play/test_parity.py runs short ones",
    "mypy": CHECKS,
    "pytest -q": CHECKS,
    "pytest tests/agents tests/policies tests/training": CHECKS,
    "make soak": SOAK,
    "make soak MINUTES=30": SOAK,
    "make article": ARTICLE,
    "python -m scripts.article --measure": ARTICLE,
    "python -m scripts.article --agents dqn sac --seeds 30 31": ARTICLE,
    f"{PUBLISH} PRESET=article": "tests/article/test_article_run.py writes this table",
    f"{PUBLISH} PRESET=run": "needs its budget; tests/test_publish.py writes this table",
    f"{PUBLISH} PRESET=replicate": "needs the default's claims; tests/test_publish.py",
    f"{PUBLISH} PRESET=thesis": "as of families; tests/test_publish.py",
    PUBLISH: "needs films of 13 s; tests/test_publish.py makes its table and pictures",
    "make try": "minutes of training; tests/test_preset.py runs it without",
    "make cost PRESET=families": COST,
    "make cost SET=agents.sac.learning_rate=0.001": COST,
    'make cost SET="evaluate.episodes=64 seeds=[30,31]"': COST,
    **{f"make preset PRESET={name}": HOURS for name in LONG},
    'make preset PRESET=families STAGES="compare speed"': HOURS,
    "dvc exp run $(cat presets/NAME)": "stands for the presets",
    **{command: TUNE for command in ("make tune", "make tune AGENT=td3 PRESET=families")},
    **{f"make tune AGENT=sac TRIALS=40{own}": TUNE for own in ("", " SAMPLER=random")},
    "dvc exp run $(cat presets/NAME presets/tuned-AGENT)": "stands for the presets",
    "dvc exp run $(cat presets/tuned-sac)": "the preset of a search; tests/tuning/test_outcome.py",
    f"{PUBLISH} PRESET=tuning": "tests/test_publish.py writes this table",
    "make bench": MEASURES,
    "python -m benchmarks profiles scale": MEASURES,
    "python -m benchmarks sac_vs_sb3": MEASURES,
    "python -m benchmarks vector_env_vs_envpool": MEASURES,
    "python -m benchmarks.full_run": MEASURES,
}
TOGETHER = CHANGES | TABLES.keys() | VIEWS.keys()  # in tests of their own, with these
TOGETHER |= {EXPERIMENT, BACK, AGAIN, FORTH, ON_BRANCH}


def documented() -> set[str]:
    """Return the commands of all documents: lines of console blocks, indented lines, `code`."""
    return {
        command
        for document in DOCUMENTS
        for command in commands(document.read_text(encoding="utf-8"))
    }


def commands(text: str) -> Iterator[str]:
    """Yield the commands of a document, without the comments after them."""
    block = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
    blocks = [lines for kind, lines in block.findall(text) if kind in ("console", "sh", "bash")]
    prose = block.sub("", text)
    lines = re.findall(r"^ {4}(\S.*)$", prose, re.MULTILINE)
    code = [" ".join(words.split()) for words in re.findall(r"`([^`]+)`", prose)]
    typed = [line.split(" #")[0].strip() for lines in blocks for line in lines.splitlines()]
    yield from filter(None, typed)
    for command in [*lines, *code]:
        if command.split()[0] in TOOLS and command not in NAMES:
            yield command


@pytest.fixture
def installed(project: Project) -> Project:
    """The project with what is installed here, as in copies of presets."""
    if not (project.folder / ".venv").is_symlink():
        (project.folder / ".venv").symlink_to(sys.prefix)
    return project


def test_commands_are_found_in_blocks_indented_lines_and_code() -> None:
    text = "Run `dvc repro\nbuild` or `make`, not `dvc`:\n\n    make test\n    more text\n"
    text += "- as\n  ```console\n  git gc && ls   # why\n  ```\n```yaml\nmake: 1\n```\n"
    assert list(commands(text)) == ["git gc && ls", "make test", "dvc repro build", "make"]


def test_the_tables_name_what_is_documented() -> None:
    assert documented() >= ELSEWHERE.keys() | TOGETHER
    assert not ELSEWHERE.keys() & TOGETHER
    for reason in ELSEWHERE.values():
        assert all((ROOT / name).is_file() for name in re.findall(r"[\w/]+\.py", reason)), reason


@pytest.mark.parametrize("command", sorted(documented() - ELSEWHERE.keys() - TOGETHER))
def test_a_command_changes_no_result(installed: Project, command: str) -> None:
    """`project`, which `installed` takes, looks whether anything has changed."""
    here = command.replace("URL", "../remote")
    installed.run("timeout", "120", "bash", "-c", here)  # or the tables lack one that takes long


@pytest.mark.parametrize("command", VIEWS)
def test_the_viewer_opens(installed: Project, command: str) -> None:
    """In a browser, as there is no display."""
    done = installed.type(f"timeout 20 {command}", check=False)
    assert f"media/{VIEWS[command]}.rrd" in done.stdout + done.stderr
    assert "a browser shows it at the last address below" in done.stdout


def test_a_recording_that_is_not_there_is_refused(installed: Project) -> None:
    done = installed.type("make view AGENT=nobody", check=False)
    assert "recordings in media/: given 'nobody', allowed: dqn, lineup, " in done.stderr


def test_the_cost_of_other_values_is_told_beforehand(installed: Project) -> None:
    told = installed.type("make cost SET='evaluate.episodes=3 evaluate.baseline_episodes=3'")
    stages = {line.split()[0] for line in told.stdout.splitlines() if " core-hours, " in line}
    assert stages >= {"evaluate@sac", "record@sac", *AFTER_ALL}
    assert not any(stage.startswith(("train@", "scaling@")) for stage in stages)


def test_an_experiment_comes_and_goes(project: Project) -> None:
    """With an agent more, so that it leaves files where there were none."""
    mine = project.state()
    agents = params_file.load(project.folder / "params.yaml").model_dump()["agents"]
    project.change_params(agents=agents | {"still": agents["random"]})
    # Stages of every kind of output; the others would take longer and show the same.
    done = project.type(f"{EXPERIMENT} {' '.join(TARGETS)}")
    ran = {line.split("'")[1] for line in done.stdout.splitlines() if "Running stage" in line}
    assert ran == {"check", "train@sac", "train@still", *TARGETS}
    others = {
        f"{stage}@{agent}" for stage in ("robustness", "scaling") for agent in ("sac", "still")
    }
    assert project.stale() == {"record@sac", *others, *AFTER_ALL}
    experiment = project.state()
    new = experiment.files.keys() - mine.files.keys()
    assert {name.split("/")[0] for name in new} == {"models", "media", "results"}
    for forth in (FORTH, AGAIN):
        project.go_back()
        assert not project.state().changes(mine)
        assert project.stale() == set()
        project.type(forth)
        assert not project.state().changes(experiment)
    check_what_changes_show(project)
    project.go_back()


def check_what_changes_show(project: Project) -> None:
    """Compare an experiment with what is committed, as the documents say."""
    told = project.type("dvc params diff --md").stdout
    before = presets.load("smoke").agent("sac").model_dump()["learning_rate"]
    row = f"| params.yaml | agents.sac.learning_rate | {before} | 0.001 |"
    assert row in " ".join(told.split())
    metrics = json.loads(project.type("dvc metrics diff --json").stdout)
    assert set(metrics) == {f"results/agents/{agent}/metrics.json" for agent in ("sac", "still")}
    shown = project.type("dvc exp show --only-changed --csv").stdout
    columns = shown.splitlines()[0].split(",")
    assert {"agents.sac.learning_rate", "results/agents/sac/metrics.json:return"} <= set(columns)
    assert not any(column.startswith(("agents.dqn", "results/agents/dqn")) for column in columns)
    assert "faster" in shown
    project.type("dvc plots diff")
    page = (project.folder / "dvc_plots" / "index.html").read_text(encoding="utf-8")
    assert "workspace" in page and "HEAD" in page


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
    branch = ("git", "branch", "--show-current")
    assert project.run(*branch).stdout == ""
    project.type(ON_BRANCH)
    project.go_back()
    assert project.run(*branch).stdout == "main\n"
    assert project.stale() == set()


@pytest.mark.parametrize("command", TABLES)
def test_a_table_is_published(installed: Project, command: str) -> None:
    """Of this project's own results, in place of the preset's."""
    preset, name = TABLES[command]
    document = installed.folder / "docs" / name
    before = document.read_text(encoding="utf-8")
    copy = installed.folder / ".presets" / preset
    copy.parent.mkdir(exist_ok=True)
    copy.symlink_to(installed.folder)
    installed.type(command)
    assert document.read_text(encoding="utf-8") != before
    copy.unlink()
    installed.go_back()


def test_the_snippets_run(project: Project) -> None:
    """One after the other, as they share what takes long: the imports."""
    program = "\n".join(SNIPPETS)
    for text, own in HERE.items():
        assert program.count(text) == 1
        program = program.replace(text, own)
    project.run("python", "-c", program)
