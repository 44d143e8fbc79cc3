"""Progress of work whose results come in parts: a bar on a terminal, elsewhere lines."""

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from typing import TextIO, TypeVar

from tqdm import tqdm

Part = TypeVar("Part", bound=Sized)

SECONDS_BETWEEN_LINES = 10.0


def shown(
    parts: Iterable[Part], total: int, name: str, unit: str, stream: TextIO | None = None
) -> Iterator[Part]:
    """Yield parts as they come, and show how much of the work they are.

    Args:
        parts: The results; the length of a part is its share of the work.
        total: The length of all parts.
        name: Whose work it is.
        unit: What the work is counted in.
        stream: Where to show it; by default standard error.
    """
    stream = stream or sys.stderr
    if stream.isatty():
        with tqdm(desc=name, total=total, unit=f" {unit}", file=stream) as bar:
            for part in parts:
                yield part
                bar.update(len(part))
        return
    if total:
        seconds = f"{SECONDS_BETWEEN_LINES:.0f} s"
        told = f"{total:,} {unit}; output is not a terminal, so a line at most every {seconds}"
        print(f"{name}: {told}", file=stream, flush=True)
    done, printed = 0, (began := time.monotonic())
    for part in parts:
        yield part
        done, now = done + len(part), time.monotonic()
        if now - printed >= SECONDS_BETWEEN_LINES:
            printed, rate = now, done / (now - began)
            left = tqdm.format_interval((total - done) / rate)
            print(f"{name}: {done:,}/{total:,} {unit}, {left} left", file=stream, flush=True)
