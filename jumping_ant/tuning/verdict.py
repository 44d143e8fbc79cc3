"""The verdict on a study's best settings: trainings with the whole budget, from fresh seeds.

The best of many trials was lucky. So it and the agent as it is are trained again from seeds, and
judged from start states, that neither the study nor anything else has seen; another best trial gets
others. The test is the one by which comparisons tell two agents apart.
"""

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
from numpy.typing import NDArray

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.base import process
from jumping_ant.base.errors import StoppedError
from jumping_ant.comparison import estimates
from jumping_ant.comparison.claims import findings, verdicts
from jumping_ant.comparison.claims.findings import Efforts, Finding, Sample
from jumping_ant.comparison.step_down import adjust
from jumping_ant.compute import jobs
from jumping_ant.compute.workers import Work
from jumping_ant.looks.wording import capitalized, number
from jumping_ant.params.blocks import CompareParams
from jumping_ant.tuning.objective import FRESH, Fault
from jumping_ant.tuning.search import Task

WORDS = {
    "supported": "better",
    "refuted": "worse",
    "equivalent": "equivalent",
    "inconclusive": "open",
}
OPEN = WORDS["inconclusive"]
UNCHANGED = "unchanged"  # no trial did better than the agent's own settings
BEFORE, AFTER = "before", "after"
LARGEST_BLOCK = 100  # training seeds of a verdict
NEVER = (math.inf, math.inf)  # later than one whose budget just ended

Array = NDArray[np.float64]
Key = tuple[str, int]
"""Which settings, and which of the fresh seeds."""


def without_training(word: str) -> dict[str, Any]:
    """Return a verdict where there is nothing to compare, and so no number."""
    return {"verdict": word} | dict.fromkeys((BEFORE, AFTER, "p", "difference", "low", "high"))


@dataclass(frozen=True)
class Fresh:
    """The trainings that judge a trial.

    Attributes:
        study: The study, which notes what they found.
        task: What is tuned.
        compare: How agents are compared.
        episodes: Of each seed, from start states of its own.
        trial: Number of the trial.
        agent: The agent with the trial's settings.
    """

    study: optuna.Study
    task: Task
    compare: CompareParams
    episodes: int
    trial: int
    agent: AgentBlock

    @property
    def keys(self) -> list[Key]:
        """What is trained."""
        return [
            (which, seed)
            for seed in range(self.task.tuning.fresh_seeds)
            for which in (BEFORE, AFTER)
        ]

    def run(self, workers: int, say: Callable[[str], None]) -> None:
        """Train what is not noted yet.

        Raises:
            StoppedError: A signal asked for a stop.
            WorkerError: The workers of a seed died repeatedly.
        """
        name = "{0[0]}, {0[1]}".format
        for key, found in jobs.stream(self.work, self._left(), workers, say, name):
            note: dict[str, Any]
            if isinstance(found, Fault):
                note, told = {"fault": found.reason}, found.reason
            else:
                own = found.mean_return
                note = {"return": own, "seconds": found.seconds, "onset": found.onset}
                told = number(own)
            self.study.set_user_attr(self._name(key), note)
            say(f"fresh seed {key[1] + 1}, {key[0]}: {told}")
        missing = [key for key in self.keys if self._name(key) not in self.study.user_attrs]
        if missing:
            raise StoppedError(f"the same command resumes; {len(missing)} trainings are left")

    def _left(self) -> Iterator[Key]:
        """Yield what is not noted when a worker is free, at last what another machine has begun."""
        taken: set[Key] = set()
        for is_last in (False, True):
            for key in self.keys:
                noted, begun = self.study.user_attrs, f"begun {self._name(key)}"
                if key in taken or self._name(key) in noted or (begun in noted and not is_last):
                    continue
                self.study.set_user_attr(begun, process.this_process())
                taken.add(key)
                yield key

    def work(self, key: Key) -> Work:
        """Return the job of a fresh seed."""
        which, seed = key
        agent = self.agent if which == AFTER else self.task.space.agent
        seeds = self._block(LARGEST_BLOCK)
        starts = self._block(self.task.tuning.fresh_seeds * self.episodes)
        own = starts[seed * self.episodes : (seed + 1) * self.episodes]
        return self.task.work(agent, seeds[seed], own, num_threads=1)

    def verdict(self) -> dict[str, Any]:
        """Return the verdict, what it rests on, and in words what was compared.

        The difference is the median over all pairs of seeds (Hodges and Lehmann 1963): of returns,
        or of the seconds that are saved.
        """
        is_timed = self.task.tuning.target_return is not None
        finding, before, after = self._of_seconds() if is_timed else self._of_returns()
        more, less = (before, after) if is_timed else (after, before)
        median = estimates.pairwise_median(np.subtract)
        difference = estimates.estimate(median, [more, less], self.compare)
        middle = np.median if is_timed else self._iqm
        level = self.compare.levels[0] + verdicts.ROUNDING
        (adjusted,) = adjust([(finding.p, finding.margin.p if finding.margin else None)])
        returns, seconds = (
            {which: self._numbers(which, name).tolist() for which in (BEFORE, AFTER)}
            for name in ("return", "seconds")
        )
        return {
            BEFORE: float(middle(before)),
            AFTER: float(middle(after)),
            "verdict": WORDS[verdicts.verdict(finding.side, adjusted, level)],
            "p": finding.p,
            "p_equivalence": finding.margin.p if finding.margin else None,
            **difference.as_dict("difference"),
            "evidence": f"{capitalized(finding.evidence)}.",
            "returns": returns,
            "seconds": seconds,
        }

    def _iqm(self, sample: Array) -> Array:
        return estimates.estimate_iqm(sample, self.compare.confidence).value

    def _of_returns(self) -> tuple[Finding, Array, Array]:
        before, after = (self._numbers(which, "return") for which in (BEFORE, AFTER))
        first, second = Sample(f"{self.task.name} tuned", after), Sample(self.task.name, before)
        margin = self.compare.margins.returns
        ends = (-margin, margin)
        found = findings.independent("return", first, second, self.compare, ends=ends)
        return found, before, after

    def _of_seconds(self) -> tuple[Finding, Array, Array]:
        before, after = (
            Efforts(
                label,
                np.array([own["onset"] for own in self._noted(which)]),
                self._numbers(which, "seconds"),
            )
            for which, label in ((BEFORE, self.task.name), (AFTER, f"{self.task.name} tuned"))
        )
        ratio = self.compare.margins.seconds
        quantity = f"seconds to a return above {self.task.tuning.target_return:g}"
        ends = (1 / ratio, ratio)
        found = findings.more_effort(quantity, before, after, self.compare, ends)
        return found, before.spent, after.spent

    def _block(self, size: int) -> range:
        """Return so many fresh numbers, hardly ever those of another study or another trial."""
        content = json.dumps([self.study.study_name, self.trial])
        number = int(hashlib.sha256(content.encode()).hexdigest()[:8], 16)
        first = size * (number % (len(FRESH) // size))
        return FRESH[first : first + size]

    def _name(self, key: Key) -> str:
        size = f"{self.task.tuning.fresh_seeds} x {self.episodes}"  # on which the starts depend
        return f"fresh {self.trial} {size} {key[0]} {key[1]}"

    def _noted(self, which: str) -> list[Mapping[str, Any]]:
        """Return what was noted of seeds; one that diverged counts as the worst of all of them."""
        noted = self.study.user_attrs
        notes = {key: noted[self._name(key)] for key in self.keys}
        trained = [note for note in notes.values() if "fault" not in note]
        worst = {
            "return": min((note["return"] for note in trained), default=0.0),
            "seconds": max((note["seconds"] for note in trained), default=0.0),
            "onset": NEVER,
        }
        return [worst | note for key, note in notes.items() if key[0] == which]

    def _numbers(self, which: str, name: str) -> Array:
        return np.array([own[name] for own in self._noted(which)])
