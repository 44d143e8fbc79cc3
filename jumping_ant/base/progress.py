"""Progress of work: a bar on a terminal, elsewhere a line every few seconds and one at the end."""

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import closing
from typing import TypeVar

from tqdm import tqdm

from jumping_ant.base.errors import printable

Part = TypeVar("Part", bound=Sized)

SECONDS_BETWEEN_LINES = 10.0


class Progress:
    """The progress of one piece of work, on standard error."""

    def __init__(self, name: str, total: int, unit: str) -> None:
        self._name, self._total, self._unit = name, total, unit
        self._bar = tqdm(desc=name, total=total, unit=f" {unit}", disable=None)
        self._printed = time.monotonic()

    def show(self, done: int, seconds: float, note: str = "") -> None:
        """Show how much has been done in how many seconds."""
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(done - self._bar.n)
        if self._bar.disable and time.monotonic() - self._printed >= SECONDS_BETWEEN_LINES:
            self._printed = time.monotonic()
            rate = done / max(seconds, 1e-9)
            left = tqdm.format_interval(max(self._total - done, 0) / max(rate, 1e-9))
            amount = f"{done:,}/{self._total:,} {self._unit}"
            say(f"{self._name}: {amount}, {rate:,.0f}/s, {left} left{note and f', {note}'}")

    def finish(self, done: int, seconds: float, note: str = "") -> None:
        """Show that all is done."""
        if self._bar.disable:
            took = tqdm.format_interval(seconds)
            say(f"{self._name}: done, {done:,} {self._unit} in {took}{note and f', {note}'}")

    def close(self) -> None:
        """Leave the terminal in order."""
        self._bar.close()


def say(line: str) -> None:
    """Print a line to standard error, above the bars."""
    tqdm.write(printable(line), file=sys.stderr)


def shown(parts: Iterable[Part], total: int, name: str, unit: str) -> Iterator[Part]:
    """Yield parts as they come, and show which share of the `total` length they are."""
    done, began = 0, time.monotonic()
    with closing(Progress(name, total, unit)) as progress:
        for part in parts:
            yield part
            done += len(part)
            progress.show(done, time.monotonic() - began)
        if total:
            progress.finish(done, time.monotonic() - began)
