"""What agents keep of their return under perturbations: `results/robustness.json`.

At each level of a perturbation a seed keeps the return there over its return without any. Three
numbers tell what an agent withstands. Two of them are levels, each the mildest one from which on,
at all more severe levels, too,

- `half`: the interquartile mean over seeds of what they keep is below one half;
- `crossing`: a metronome, which does not look at the robot, returns more on average from the same
  starts, by more than the margin (after Raffin et al. 2024, "An open-loop baseline for
  reinforcement learning locomotion tasks"). It is not tested: the claims on perturbed episodes are.

None stands where no level does it. The third, `worst`, is the least that is kept at any level.

docs/measures-and-claims.md fixed the claims beforehand; they are a family of their own.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.comparison.claims import findings, verdicts
from jumping_ant.comparison.claims.evidence import Case, Compare
from jumping_ant.comparison.claims.field import Field, pairs
from jumping_ant.comparison.claims.findings import Finding, Sample
from jumping_ant.comparison.claims.statements import Row, Table
from jumping_ant.comparison.estimates import estimate_iqm
from jumping_ant.comparison.results import AgentResults
from jumping_ant.evaluation import perturbed
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.perturbations import NAMES, NONE, SENSING, Array, Condition

Returns = Mapping[Condition, Array]
"""An agent's mean return of every seed under each condition, (num_seeds,); `NONE` is the first."""
Played = Mapping[str, Returns]
"""What each agent returns under each condition."""

HALF = 0.5
SEVERE = 3  # levels of a perturbation, the last ones, that the claims on it average


def summarize(root: Path, params: Params, results: Mapping[str, AgentResults]) -> dict[str, Any]:
    """Return what each agent keeps under each perturbation, and the claims on it.

    Args:
        root: The project's folder, with the tables of perturbed episodes.
        params: All parameters.
        results: Of each agent in undisturbed episodes.
    """
    played = {name: perturbed.read(root, params, name) for name in results}
    episodes = params.training.evaluation_episodes
    field = Field(list(results.values()), episodes)
    agents = {}
    for name, agent in results.items():
        if played[name]:
            metronome = None if agent.is_baseline else field.metronome(agent)
            beside = played[metronome.name] if metronome else None
            confidence = params.compare.confidence
            agents[name] = withstood(played[name], beside, margin(params), confidence)
    return {
        "perturbations": [name for name, row in LEVELS.items() if row.values],
        "agents": agents,
        "claims": verdicts.check(results, params.compare, episodes, table(params, played)),
    }


def withstood(
    returns: Returns, metronome: Returns | None, margin: float, confidence: float
) -> dict[str, dict[str, Any]]:
    """Return what an agent keeps and withstands, by perturbation.

    Args:
        returns: The agent's.
        metronome: Those of the metronome beside it, if there is one.
        margin: By more than this the metronome has to be ahead.
        confidence: Of the intervals of what is kept.
    """
    shares = kept(returns)
    by_name = {}
    for name in dict.fromkeys(condition.perturbation for condition in shares):
        conditions = [condition for condition in shares if condition.perturbation == name]
        levels = [condition.level for condition in conditions]
        numbers = [_interval(shares[condition], confidence) for condition in conditions]
        middle = [one["retention"] for one in numbers]
        crossing = None
        if metronome is not None:
            leads = [metronome[one].mean() - returns[one].mean() for one in conditions]
            crossing = _from_on([lead > margin for lead in leads], levels)
        by_name[name] = {
            "level": levels,
            **{key: [one[key] for one in numbers] for key in ("retention", "low", "high")},
            "half": _from_on([share is not None and share < HALF for share in middle], levels),
            "crossing": crossing,
            "worst": min((share for share in middle if share is not None), default=None),
        }
    return by_name


def table(params: Params, played: Played) -> Table:
    """Return the claims."""
    severe = {name: LEVELS[name].values[-SEVERE:] for name in SENSING if LEVELS[name].values}
    world = [name for name in NAMES if name not in SENSING]
    return (
        (Field.beside_metronome, (
            *(
                Row(None, f"With {name.replace('_', ' ')} of {levels[0]:g} to {levels[-1]:g}, "
                    "{1} overtakes {0}: it returns more without looking at the robot.",
                    overtakes(params, played, [Condition(name, float(one)) for one in levels]))
                for name, levels in severe.items()
            ),
            Row(None, "Where body, floor and forces are others, looking at the robot helps: {0} "
                "keeps more of its return than {1}.", keeps_more(played, world, findings.paired)),
        )),
        (pairs("pgpe", "sac dqn"), (
            Row(9, "{0} is robust: under perturbations, it keeps more of its return than {1}.",
                keeps_more(played, NAMES, findings.independent)),
        )),
    )  # fmt: skip


def margin(params: Params) -> float:
    """Return the margin of returns, in proportion to the length of perturbed episodes."""
    share = params.robustness.episode_steps / params.env.max_episode_steps
    return share * params.compare.margins.returns


def kept(returns: Returns) -> dict[Condition, Array]:
    """Return what each seed keeps under each perturbation, (num_seeds,).

    NaN for a seed without a positive return where nothing is perturbed.
    """
    usual = np.where(returns[NONE] > 0, returns[NONE], np.nan)
    return {condition: own / usual for condition, own in returns.items() if condition != NONE}


def overtakes(params: Params, played: Played, conditions: Sequence[Condition]) -> Compare:
    """Ask whether the second agent returns more than the first, on average over conditions.

    Seeds of both play the same starts, so they are paired.
    """
    size = margin(params)

    def mean(agent: AgentResults) -> Sample:
        returns = [played[agent.name][condition] for condition in conditions]
        return Sample(agent.label, np.mean(returns, axis=0))

    def compare(case: Case) -> Finding | None:
        if not all(played[agent.name] for agent in case.agents):
            return None
        first, second = case.samples(mean)
        return findings.paired("Return", second, first, case.params, (-size, size))

    return compare


def keeps_more(played: Played, names: Collection[str], compared: Callable[..., Finding]) -> Compare:
    """Ask whether the first agent keeps more than the second, over all levels of perturbations.

    Args:
        played: What each agent returns under each condition.
        names: The perturbations.
        compared: The test: `findings.paired`, as agents play the same starts, or
            `findings.independent`.
    """

    def shares(agent: AgentResults) -> list[Array]:
        returns = played[agent.name]
        by_condition = kept(returns) if returns else {}
        return [own for condition, own in by_condition.items() if condition.perturbation in names]

    def compare(case: Case) -> Finding | None:
        if not all(map(shares, case.agents)):
            return None
        samples = case.samples(lambda agent: Sample(agent.label, np.mean(shares(agent), axis=0)))
        return compared("Share of the return that is kept", *samples, case.params)

    return compare


def _interval(shares: Array, confidence: float) -> Mapping[str, float | None]:
    """Return the interquartile mean of what seeds keep with its interval; None without a seed."""
    known = shares[~np.isnan(shares)]
    if not len(known):
        return dict.fromkeys(("retention", "low", "high"))
    return estimate_iqm(known, confidence).as_dict("retention")


def _from_on(does: Sequence[bool], levels: Sequence[float]) -> float | None:
    """Return the mildest level from which on all do, if any."""
    last_without = max((place for place, own in enumerate(does) if not own), default=-1)
    return levels[last_without + 1] if last_without + 1 < len(levels) else None
