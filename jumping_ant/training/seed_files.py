"""The files of one seed, which the events of its training become.

`curve.csv` grows row by row. When training ends, `policy.zip` becomes the snapshot that won in
validation, or the last policy, as `training.publish` specifies; `validation.csv` has what the
finalists returned (see `model_selection`). `final.zip` is always the last policy.
"""

import math
from typing import Any, TextIO

import numpy as np

from jumping_ant.agents.events import Checkpoint, Finished, Progress, Snapshot
from jumping_ant.base import progress, tables
from jumping_ant.base.files import write_all
from jumping_ant.base.paths import SeedPaths
from jumping_ant.policies import policy_file
from jumping_ant.training import curves, model_selection
from jumping_ant.training.checkpoints import Checkpoints, Saved
from jumping_ant.training.curves import COLUMNS, VALIDATION_COLUMNS
from jumping_ant.training.seed_run import Report


class SeedFiles:
    """The files and the progress of one seed, of `total` control steps."""

    def __init__(
        self, agent: str, number: int, total: int, paths: SeedPaths, checkpoints: Checkpoints
    ) -> None:
        self.number = number
        self.finished: Saved | None = None
        self.saved_steps = 0
        self._owner = curves.owner(agent, number)
        self._paths = paths
        self._checkpoints = checkpoints
        self._progress = progress.Progress(f"{agent} seed {number}", total, "steps")
        self._return = "-"  # of the latest training episodes
        self._timing: list[tuple[int, float]] = []
        self._curve = ""
        self._file: TextIO

    def __enter__(self) -> "SeedFiles":
        self._paths.folder.mkdir(parents=True, exist_ok=True)
        # DVC clears the folder; else no older policy remains, nor a link into DVC's cache.
        for path in self._paths.files:
            path.unlink(missing_ok=True)
        self._file = self._paths.curve.open("x", newline="", encoding="utf-8")
        if saved := self._checkpoints.finished(self.number):
            self._say(f"trained before, {saved.env_steps:,} steps")
            self._resume_from(saved)
            self._finish(saved)
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.close()
        self._file.close()

    def _say(self, line: str) -> None:
        progress.say(f"{self._owner['agent']}: seed {self.number}: {line}")

    def start(self) -> Saved | None:
        """Return the state to resume from, None for a fresh start, and restore the curve."""
        saved = self._checkpoints.load(self.number)
        if saved:
            self._say(f"resumes from {saved.env_steps:,} steps")
        self._resume_from(saved)
        return saved

    def _resume_from(self, saved: Saved | None) -> None:
        self._timing = list(saved.timing) if saved else []
        self.saved_steps = saved.env_steps if saved else 0
        self._curve = ""
        self._file.seek(0)
        self._file.truncate()
        self._write(saved.curve if saved else "")

    def take(self, report: Report) -> None:
        """Record an event."""
        event = report.event
        if isinstance(event, Checkpoint):
            self._checkpoints.save(self.number, self._saved(report, event.env_steps, event.content))
            self.saved_steps = event.env_steps
        elif isinstance(event, Finished):
            saved = self._saved(report, event.env_steps, event.policy)
            self._checkpoints.finish(self.number, saved)
            self._finish(saved)
            self._progress.finish(event.env_steps, report.seconds, f"return {self._return}")
        else:
            self._write_row(_row(event, report.returns))
            self._timing.append((event.env_steps, report.seconds))
            if isinstance(event, Progress):
                if not math.isnan(event.return_mean):
                    self._return = f"{event.return_mean:,.0f}"
                self._progress.show(event.env_steps, report.seconds, f"return {self._return}")

    def _saved(self, report: Report, env_steps: int, content: bytes) -> Saved:
        return Saved(
            env_steps=env_steps,
            seconds=report.seconds,
            timing=self._timing,
            machine=report.machine,
            curve=self._curve,
            candidates=report.candidates,
            content=content,
        )

    def _finish(self, saved: Saved) -> None:
        published = model_selection.winner(saved.candidates).policy
        rows = [
            self._owner
            | {
                "env_steps": one.env_steps,
                "episodes": len(one.returns),
                "return_mean": one.mean_return,
                "return_std": float(np.std(one.returns)),
            }
            for one in sorted(saved.candidates, key=lambda one: one.env_steps)
        ]
        write_all(
            {
                self._paths.final_policy: policy_file.owned(saved.content, self._paths.owner),
                self._paths.policy: policy_file.owned(published, self._paths.owner),
                self._paths.validation: tables.to_csv(rows, [*self._owner, *VALIDATION_COLUMNS]),
            }
        )
        self.finished = saved

    def _write_row(self, row: dict[str, float]) -> None:
        if not self._curve:
            others = [key for key in row if key not in COLUMNS]
            self._write(",".join([*self._owner, *COLUMNS, *others]) + "\n")
        columns = self._curve.partition("\n")[0].split(",")[len(self._owner) :]
        cells = [*map(str, self._owner.values()), *(_cell(row.get(name)) for name in columns)]
        self._write(",".join(cells) + "\n")

    def _write(self, text: str) -> None:
        self._curve += text
        self._file.write(text)
        self._file.flush()  # live tracking reads the file


def _row(event: Progress | Snapshot, returns: tuple[float, ...]) -> dict[str, float]:
    if isinstance(event, Snapshot):
        return {
            "env_steps": event.env_steps,
            "evaluation_return_mean": float(np.mean(returns)),
            "evaluation_return_std": float(np.std(returns)),
        }
    fields = {name: getattr(event, name) for name in COLUMNS if hasattr(event, name)}
    return fields | event.extra


def _cell(value: Any) -> str:
    """Format a number so that it reads back the same; empty for none, and for no finite one."""
    return "" if value is None or not math.isfinite(value) else repr(value)
