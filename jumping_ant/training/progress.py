"""The progress display of a training run: one line per seed.

On a terminal each seed has a progress bar; elsewhere each prints a line every few seconds.
"""

import sys
import time
from types import TracebackType
from typing import Self, TextIO

from tqdm import tqdm

SECONDS_BETWEEN_LINES = 10.0


class TrainingProgress:
    """Shows each seed's steps of a total budget, its return, rate and time left."""

    def __init__(
        self, agent: str, seeds: list[int], total: int, stream: TextIO | None = None
    ) -> None:
        stream = stream or sys.stderr
        self.agent = agent
        self._is_terminal = stream.isatty()
        self._stream = stream
        self._returns: dict[int, str] = {}
        self._printed = dict.fromkeys(seeds, time.monotonic())
        self._bars = {
            seed: tqdm(
                desc=f"{agent} seed {seed}",
                total=total,
                unit=" steps",
                file=stream,
                position=position,
                disable=None if self._is_terminal else True,
            )
            for position, seed in enumerate(seeds)
        }
        self._started: dict[int, float] = {}
        self._total = total

    def __enter__(self) -> Self:
        """Print how progress will be reported if there are no bars."""
        if not self._is_terminal:
            seeds = "1 seed" if len(self._bars) == 1 else f"{len(self._bars)} seeds"
            self._print(
                f"{self.agent}: training {seeds}; output is not a terminal, "
                f"so a line per seed every {SECONDS_BETWEEN_LINES:.0f} s"
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the progress bars."""
        for bar in self._bars.values():
            bar.close()

    def update(self, seed: int, env_steps: int, seconds: float, mean_return: float | None) -> None:
        """Show the progress of a seed; its return is None if no training episode ended recently."""
        if mean_return is not None:
            self._returns[seed] = f"{mean_return:,.0f}"
        if self._is_terminal:
            bar = self._bars[seed]
            bar.set_postfix_str(f"return {self._returns.get(seed, '-')}", refresh=False)
            bar.update(env_steps - bar.n)
        elif time.monotonic() - self._printed[seed] >= SECONDS_BETWEEN_LINES:
            self._printed[seed] = time.monotonic()
            self._print(self._line(seed, env_steps, seconds))

    def say(self, line: str) -> None:
        """Print a line that is not overwritten."""
        tqdm.write(f"{self.agent}: {line}", file=self._stream)
        self._stream.flush()

    def finish(self, seed: int, env_steps: int, seconds: float) -> None:
        """Report that a seed is finished."""
        if not self._is_terminal:
            self._print(
                f"{self.agent} seed {seed}: done, {env_steps:,} steps in "
                f"{tqdm.format_interval(seconds)}, return {self._returns.get(seed, '-')}"
            )

    def _line(self, seed: int, env_steps: int, seconds: float) -> str:
        rate = env_steps / max(seconds, 1e-9)
        left = tqdm.format_interval(max(self._total - env_steps, 0) / max(rate, 1e-9))
        return (
            f"{self.agent} seed {seed}: {env_steps:,}/{self._total:,} steps, "
            f"return {self._returns.get(seed, '-')}, {rate:,.0f} steps/s, {left} left"
        )

    def _print(self, line: str) -> None:
        print(line, file=self._stream, flush=True)
