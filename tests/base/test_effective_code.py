"""What of a file counts as code."""

import ast

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
    ("old", "new", "is_code"),
    [
        ("A house.", "Another house.", False),
        ("# Why it is so.", "# Why it is so, and\n# no other way.", False),
        ("\n\n# Why", "# Why", False),
        ("= 2", "= 3", True),
        ("with salt", "with pepper", True),
        ("salt\n\n", "salt\n", True),
        ("one line", "two", True),
    ],
)
def test_only_what_runs_counts(old: str, new: str, is_code: bool) -> None:
    assert old in SOURCE
    assert (effective(SOURCE.replace(old, new)) != EFFECTIVE) is is_code


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
