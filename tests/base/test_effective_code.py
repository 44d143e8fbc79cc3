"""What of a file counts as code."""

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base.effective_code import effective, read
from jumping_ant.base.files import CODE_ROOT

SOURCE = '''"""A module."""

import os  # of the system


# Why it is so.
class House:
    """A house."""

    rooms: int = 2
    """How many rooms it has."""

    def cook(self) -> str:
        """Cook.

        # Not a comment.
        """
        text = """Soup
  # with salt

and bread"""  # a string
        return (  # long

            text + "# 1"
        )


def eat(): "in one line"
'''
EFFECTIVE = '''import os
class House:
    rooms: int = 2
    def cook(self) -> str:
        text = """Soup
  # with salt

and bread"""
        return (
            text + "# 1"
        )
def eat(): "in one line"
'''


def test_comments_docstrings_and_blank_lines_do_not_count() -> None:
    assert effective(SOURCE) == EFFECTIVE


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("A house.", "Another house."),
        ("# Why it is so.", "# Why it is so, and\n# no other way."),
        ("  # of the system", ""),
        ('    """How many rooms it has."""\n', ""),
        ("\n\n# Why", "# Why"),
    ],
)
def test_what_is_no_code_changes_nothing(old: str, new: str) -> None:
    assert old in SOURCE
    assert effective(SOURCE.replace(old, new)) == EFFECTIVE


@pytest.mark.parametrize(
    ("old", "new"),
    [("= 2", "= 3"), ("with salt", "with pepper"), ("salt\n\n", "salt\n"), ("one line", "two")],
)
def test_any_other_change_counts(old: str, new: str) -> None:
    assert old in SOURCE
    assert effective(SOURCE.replace(old, new)) != EFFECTIVE


def test_nothing_that_runs_is_lost() -> None:
    """The syntax trees agree, but for statements that are only a string."""
    for path in (CODE_ROOT / "jumping_ant").rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            for name in ("body", "orelse", "finalbody"):
                if isinstance(body := getattr(node, name, None), list):
                    setattr(node, name, [each for each in body if not _is_string(each)])
        try:
            again = ast.parse(read(path))
        except SyntaxError:  # a body that was only a docstring
            continue
        assert ast.dump(tree) == ast.dump(again), path


def _is_string(node: ast.stmt) -> bool:
    value = getattr(node, "value", None)
    return isinstance(node, ast.Expr) and isinstance(getattr(value, "value", None), str)


def test_every_python_reads_the_same(tmp_path: Path) -> None:
    module = Path(sys.modules[read.__module__].__file__ or "")
    program = (
        f"import runpy; read = runpy.run_path({str(module)!r})['read']\n"
        "import hashlib, pathlib, sys\n"
        f"files = sorted(pathlib.Path({str(CODE_ROOT / 'jumping_ant')!r}).rglob('*.py'))\n"
        "print(hashlib.sha256(''.join(map(read, files)).encode()).hexdigest())"
    )
    found = {shutil.which(f"python3.{minor}") for minor in range(11, 16)} - {None}
    outputs = set()
    for python in {sys.executable, *found}:
        done = subprocess.run([str(python), "-c", program], capture_output=True, encoding="utf-8")
        if done.returncode == 0 or python == sys.executable:  # others may be broken shims
            outputs.add(done.stdout)
    assert len(outputs) == 1 and len(outputs.pop()) == 65
