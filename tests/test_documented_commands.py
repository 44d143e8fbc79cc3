"""The commands, paths and links of the documents exist; tests/test_smoke.py runs the main ones."""

import re
import shlex
import shutil
import subprocess
from fnmatch import fnmatch
from itertools import takewhile
from pathlib import Path

import pytest
from dvc.cli import DvcParserError
from dvc.cli.parser import get_main_parser
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT as ROOT
from scripts import checkout

DOCUMENTS = {"README.md", "CONTRIBUTING.md", "benchmarks/README.md"}
DOCUMENTS |= {f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")}
TOOLS = ("make", "dvc", "git", "python", "mlflow", "rerun", "pytest", "ruff", "mypy", "ray")
OF_THE_SYSTEM = ("cd", "export", "source", "sudo")
BLOCK = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?!\w+:)([^)\s#]*)#?([^)\s]*)\)")  # but addresses
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
PATH = re.compile(r"[\w.<>*-]+(/[\w.<>*-]+)*/?")
CODE = (".py", ".js", ".sh", ".yaml", ".lock")  # files that are also named without their folders
EARLIER = re.compile(r"`[^`]+`,? of\s+commit\s+[0-9a-f]{7}")  # a script that has gone
PLACEHOLDER = re.compile(r"<\w+>|\b[A-Z]{3,}\b|(?<=/)(agent|algorithm|stage)\b")
# A repository, a key of `info`, and files that users, `make` and `make tune` write.
ELSEWHERE = {"mdipietro09/RoboticsPy", "reward/low_torso", "off_policy/mine.py"}
ELSEWHERE |= {"pgpe/final", "pgpe/best_sample", "sac/seed-3"}  # a version; a run's name
ELSEWHERE |= {"eval/mean_reward", "rollout/ep_rew_mean"}  # of Stable-Baselines3
ELSEWHERE |= {".venv/bin/activate", "presets/tuned-AGENT", "presets/tuned-sac"}
FILES = [f"/{name}/" for name in checkout.project_files()]
STAGES = YAML(typ="safe").load(ROOT / "dvc.yaml")["stages"].keys()
AGENTS = YAML(typ="safe").load(ROOT / "params.yaml")["agents"].keys()
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = set(re.findall(r"^([\w-]+):", MAKEFILE, re.MULTILINE))
VARIABLES = set(re.findall(r"(?:^|\$\()([A-Z_]+)(?: \?=|[):])", MAKEFILE, re.MULTILINE))
PUBLISH = (ROOT / "scripts" / "publish.py").read_text(encoding="utf-8")
DVC = get_main_parser()


def missing(text: str) -> list[str]:
    """Return the commands and paths of a document that do not exist."""
    blocks = [lines for kind, lines in BLOCK.findall(text) if kind in ("console", "sh", "bash")]
    typed = [line.split(" #")[0].strip() for lines in blocks for line in lines.splitlines()]
    prose = EARLIER.sub("", BLOCK.sub("", text))
    code = re.findall(r"^ {4}(\S.*)$", prose, re.MULTILINE) + re.findall(r"`([^`]+)`", prose)
    commands = [*filter(None, typed), *(line for line in code if line.split()[0] in TOOLS)]
    parts = [" ".join(part.split()) for command in commands for part in command.split("&&")]
    lacking = [part for part in parts if not is_command(*shlex.split(part))]
    words = {word.strip("$()'\"") for line in [*typed, *code] for word in line.split()}
    return lacking + sorted(word for word in words if PATH.fullmatch(word) and not is_path(word))


def is_command(tool: str, *words: str) -> bool:
    """Tell whether a tool is there, and has the subcommand, target, stage, name or option."""
    if "=" in tool:  # a variable of the environment
        return is_command(*words)
    if tool == "make":
        return make_takes(*words)
    if tool == "dvc" and words:
        return dvc_takes(*words)
    if tool == "python" and words[:1] == ("-m",):
        return module_takes(*words[1:])
    return tool in OF_THE_SYSTEM or bool(shutil.which(tool, path=checkout.with_tools()["PATH"]))


def make_takes(*words: str) -> bool:
    values = dict(word.split("=", 1) for word in words if "=" in word)
    preset = values.get("PRESET", "smoke")
    has_preset = is_path(f"presets/{preset}") or f'"{preset}"' in PUBLISH
    has_stages = set(values.get("STAGES", "").split()) <= STAGES
    targets = {word for word in words if "=" not in word}
    return targets <= TARGETS and values.keys() <= VARIABLES and has_preset and has_stages


def dvc_takes(command: str, *words: str) -> bool:
    try:
        parsed = DVC.parse_args([command, *words])
    except DvcParserError:
        return False
    return command != "repro" or {target.split("@")[0] for target in parsed.targets} <= STAGES


def module_takes(module: str, *words: str) -> bool:
    path = ROOT / module.replace(".", "/")
    files = [file for file in (path.with_suffix(".py"), path / "__main__.py") if file.is_file()]
    source = "".join(file.read_text(encoding="utf-8") for file in files)
    values = takewhile(lambda word: word[0] != "-", words)
    names = [word for word in values if word not in AGENTS and not PLACEHOLDER.fullmatch(word)]
    options = [word for word in words if word[0] == "-" and word != "--help"]
    is_known = all(f'"{name}"' in source for name in names) and all(map(source.count, options))
    return source != "" and is_known


def is_path(word: str) -> bool:
    """Tell whether a path ends that of a file or folder, or git ignores it as a stage's output."""
    if word in ELSEWHERE or ("/" not in word and not word[1:].endswith(CODE)):
        return True
    pattern = f"*/{PLACEHOLDER.sub('*', word).rstrip('/')}/*"
    ignored = ("git", "check-ignore", "-q", PLACEHOLDER.sub("sac", word))
    return any(fnmatch(name, pattern) for name in FILES) or subprocess.call(ignored, cwd=ROOT) == 0


def broken_links(document: Path, files: set[Path]) -> list[str]:
    """Return the links of a document that lead to no file or heading."""
    broken = []
    for link, anchor in LINK.findall(BLOCK.sub("", document.read_text(encoding="utf-8"))):
        target = (document.parent / link).resolve() if link else document
        is_there = any(path == target or target in path.parents for path in files)
        if not is_there or (anchor and anchor not in anchors(target.read_text(encoding="utf-8"))):
            broken.append(f"{link}#{anchor}" if anchor else link)
    return broken


def anchors(text: str) -> set[str]:
    """Return the anchors that GitHub gives the headings of a document."""
    headings = HEADING.findall(BLOCK.sub("", text))
    return {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", [name.strip("/") for name in FILES if name.endswith(".md/")])
def test_what_a_document_names_exists(name: str) -> None:
    files = {ROOT / path.strip("/") for path in FILES}
    lacking = broken_links(ROOT / name, files)
    if name in DOCUMENTS:
        lacking += missing((ROOT / name).read_text(encoding="utf-8"))
    assert not lacking


def test_what_does_not_exist_is_found(tmp_path: Path) -> None:
    wrong = ["make nothing", "make ui NO=1", "make preset PRESET=no", "make preset STAGES=no"]
    wrong += ["make publish PRESET=no", "dvc exp rn", "dvc repro no", "dvc dag --no"]
    wrong += ["python -m scripts.no", "python -m scripts.tune sac --no", "X=1 no", "stages/no.py"]
    right = "make ui PORT=1 && dvc repro train@sac && python -m scripts.tune sac --trials 1 # why"
    text = "".join(f"```console\n{line}\n```\n" for line in [right, *wrong])
    assert missing(f"{text} `no.py`, `media/<agent>.mp4`") == [*wrong, "no.py", "stages/no.py"]
    other, document = tmp_path / "other.md", tmp_path / "document.md"
    other.write_text("# One, two: *three*\n```\n# no heading\n```\n", "utf-8")
    document.write_text(
        "## Here\n[a](other.md) [b](other.md#one-two-three) [c](#here) [d](https://x.org#y)\n"
        "[e](other.md#no-heading) [f](none.md) [g](#there)\n",
        "utf-8",
    )
    broken = broken_links(document, {other, document})
    assert broken == ["other.md#no-heading", "none.md", "#there"]
