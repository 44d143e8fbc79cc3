"""What a person sees of work whose results come in parts."""

import io

import pytest

from jumping_ant.base import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    """A clock that a part of the work moves."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr(progress.time, "monotonic", lambda: self.now)

    def take(self, seconds: float, part: str) -> str:
        self.now += seconds
        return part


def test_elsewhere_lines_say_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, stream = Clock(monkeypatch), io.StringIO()
    parts = (clock.take(seconds, part) for seconds, part in [(12, "ab"), (6, "c"), (6, "de")])
    assert list(progress.shown(parts, 1200, "sac", "episodes", stream)) == ["ab", "c", "de"]
    assert stream.getvalue().splitlines() == [
        "sac: 1,200 episodes; output is not a terminal, so a line at most every 10 s",
        "sac: 2/1,200 episodes, 1:59:48 left",
        "sac: 5/1,200 episodes, 1:35:36 left",
    ]


def test_nothing_to_do_has_no_line() -> None:
    stream = io.StringIO()
    assert not list(progress.shown(iter(()), 0, "random", "episodes", stream))
    assert stream.getvalue() == ""


def test_a_terminal_has_a_bar() -> None:
    stream = Terminal()
    assert list(progress.shown(["ab", "c"], 3, "pgpe", "episodes", stream)) == ["ab", "c"]
    last = stream.getvalue().split("\r")[-1]
    assert "pgpe: 100%" in last and "3/3" in last and "episodes" in last


def test_a_part_is_counted_once_it_is_used() -> None:
    """What is left includes the work on the parts, as of whoever asks for them."""
    stream = Terminal()
    parts = progress.shown(["ab", "c"], 3, "pgpe", "episodes", stream)
    assert next(parts) == "ab"
    assert "2/3" not in stream.getvalue()
