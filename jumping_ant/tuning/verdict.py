"""The verdict on a study's best settings: trainings with the whole budget, from fresh seeds.

The best of many trials was lucky. So it and the agent as it is are trained again from seeds, and
judged from start states, that neither the study nor anything else has seen; another best trial gets
others. The test is the one by which comparisons tell two agents apart.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import optuna
from numpy.typing import NDArray
from optuna.trial import FrozenTrial

from jumping_ant.base.errors import StoppedError
from jumping_ant.comparison import claims, estimates
from jumping_ant.comparison.claims import Sample
from jumping_ant.comparison.step_down import adjust
from jumping_ant.compute import jobs
from jumping_ant.compute.processes import Work
from jumping_ant.media.style import number
from jumping_ant.tuning.task import FRESH, Task, short_digest

OPEN = "open"
WORDS = {"supported": "better", "refuted": "worse", "equivalent": "equivalent"}
UNCHANGED = "unchanged"  # no trial did better than the present settings
BEFORE, AFTER = "before", "after"
NUMBERS = (BEFORE, AFTER, "p", "difference", "low", "high")  # of a verdict
SECONDS_MARGIN = 1.25  # ratio, as in tests of bioequivalence: 0.8 to 1.25
LARGEST_BLOCK = 100  # training seeds of a verdict
NEVER = (math.inf, math.inf)  # later than one whose budget just ended

Array = NDArray[np.float64]
Key = tuple[str, int]  # which settings, and which of the fresh seeds


@dataclass(frozen=True)
class Fresh:
    """The trainings that judge a trial; the study notes their results."""

    study: optuna.Study
    task: Task
    trial: FrozenTrial

    @property
    def keys(self) -> list[Key]:
        """What is trained."""
        seeds = range(self.task.settings.fresh_seeds)
        return [(which, seed) for seed in seeds for which in (BEFORE, AFTER)]

    def run(self, say: Callable[[str], None]) -> None:
        """Train what is not noted yet; a signal is a StoppedError."""
        noted = self.study.user_attrs
        left = [key for key in self.keys if self._name(key) not in noted]
        workers = jobs.num_workers(self.task.params.compute.workers, len(left))
        missing = len(left)
        for key, note in jobs.stream(self._work, left, workers, say, "{0[0]}, {0[1]}".format):
            self.study.set_user_attr(self._name(key), note)
            missing -= 1
            say(f"fresh seed {key[1] + 1}, {key[0]}: {note.get('fault') or number(note['return'])}")
        if missing:
            raise StoppedError(f"the same command resumes; {missing} trainings are left")

    def _work(self, key: Key) -> Work:
        which, seed = key
        space, episodes = self.task.space, self.task.params.evaluate.episodes
        agent = space.agent_with(self.trial.params) if which == AFTER else space.agent
        starts = self._block(self.task.settings.fresh_seeds * episodes)
        its_starts = starts[seed * episodes : (seed + 1) * episodes]
        return partial(self.task.measure, agent, self._block(LARGEST_BLOCK)[seed], its_starts, 1)

    def verdict(self) -> dict[str, Any]:
        """Return the verdict, what it rests on, and in words what was compared.

        The difference is the median over all pairs of seeds (Hodges and Lehmann 1963): of returns,
        or of the seconds that are saved.
        """
        name, tuned, compare = self.task.name, f"{self.task.name} tuned", self.task.params.compare
        returns, seconds, onsets = map(self._numbers, ("return", "seconds", "onset"))
        middles: list[Any]
        if (target := self.task.settings.target_return) is None:
            pair = [returns[AFTER], returns[BEFORE]]
            samples = Sample(tuned, pair[0]), Sample(name, pair[1])
            finding = claims.independent("Return", *samples, compare, compare.margin)
            middles = [estimates.estimate_iqm(x, compare.confidence).value for x in pair[::-1]]
        else:
            axis = f"Seconds to a return above {target:g}"
            spent = {key: np.minimum(onsets[key][:, 1], seconds[key]) for key in onsets}
            pair = [spent[BEFORE], spent[AFTER]]
            samples = Sample(name, pair[0], onsets[BEFORE]), Sample(tuned, pair[1], onsets[AFTER])
            finding = claims.efforts(axis, *samples, compare, SECONDS_MARGIN)
            middles = list(map(np.median, pair))
        difference = estimates.pairwise_median(np.subtract, pair[0], pair[1], compare.confidence)
        (adjusted,) = adjust([(finding.p, finding.p_outside)])
        return {
            **dict(zip((BEFORE, AFTER), map(float, middles), strict=True)),
            "verdict": WORDS.get(claims.verdict(finding.side, adjusted), OPEN),
            "p": finding.p,
            "p_equivalence": finding.p_outside,
            **{  # of few seeds there is no interval
                key: None if math.isnan(value) else value
                for key, value in difference.as_dict("difference").items()
            },
            "evidence": f"{finding.evidence}.",
            "returns": {which: array.tolist() for which, array in returns.items()},
            "seconds": {which: array.tolist() for which, array in seconds.items()},
        }

    def _block(self, size: int) -> range:
        """Return so many fresh numbers, hardly ever those of another study or another trial."""
        place = int(short_digest([self.study.study_name, self.trial.number]), 16)
        first = size * (place % (len(FRESH) // size))
        return FRESH[first : first + size]

    def _name(self, key: Key) -> str:
        size = f"{self.task.settings.fresh_seeds} x {self.task.params.evaluate.episodes}"
        return f"fresh {self.trial.number} {size} {key[0]} {key[1]}"

    def _numbers(self, name: str) -> dict[str, Array]:
        """Return a number of each seed; one that diverged counts as the worst of all of them."""
        noted = self.study.user_attrs
        notes = {key: noted[self._name(key)] for key in self.keys}
        trained = [note for note in notes.values() if "fault" not in note]
        worst = {
            "return": min((note["return"] for note in trained), default=0.0),
            "seconds": max((note["seconds"] for note in trained), default=0.0),
            "onset": NEVER,
        }
        return {
            which: np.array([(worst | notes[key])[name] for key in self.keys if key[0] == which])
            for which in (BEFORE, AFTER)
        }
