"""What the source article says of its agents, held against the data.

One rule gives every verdict. A claim is an effect with a bootstrap interval over seeds: *supported*
when the whole interval lies on the claimed side of no effect, *refuted* when it lies on the other,
*inconclusive* otherwise, and also when there are too few seeds for any verdict
(`statistics.enough_seeds`).

An agent stands for its algorithm, whatever its name: with two SAC agents there are two claims on
SAC and DQN. A claim on an algorithm that no agent runs is left out.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from jumping_ant import wording
from jumping_ant.comparison import AgentResults, steps_to
from jumping_ant.params import CompareParams
from jumping_ant.statistics import (
    Estimate,
    bounded_pair_scores,
    coefficient_of_variation,
    enough_seeds,
    estimate,
    interquartile_mean,
    mean_pair_score,
    probability_of_improvement,
)
from jumping_ant.wording import number

Array = NDArray[np.float64]
Claim = dict[str, str]

MUCH_BETTER = 2.0  # what "much" is taken to mean: a factor on the return
HAS_LEARNED = 2.0  # return, in multiples of the random agent's, from which an agent has learned
PARALLEL = 0.5  # share of the ideal speed-up from which work is taken to run in parallel
NO_PREFERENCE = 0.5  # a probability of improvement that favours neither side


def check(results: Mapping[str, AgentResults], params: CompareParams) -> list[Claim]:
    """Return a verdict on each claim, with the numbers behind it.

    Args:
        results: What `comparison.load` returns.
        params: Confidence, number of resamples and seed.

    Returns:
        Dictionaries with `text`, `verdict` (supported, refuted or inconclusive) and `evidence`.
    """
    runs: dict[str, list[AgentResults]] = {"random": [], "dqn": [], "sac": [], "pgpe": []}
    for agent in results.values():
        runs.setdefault(agent.algorithm, []).append(agent)
    learners = [agent for agent in results.values() if agent.algorithm != "random"]
    rivals = [agent for agent in learners if agent.algorithm != "pgpe"]
    claims = [_jumping_pays(*pair, params) for pair in product(runs["dqn"], runs["random"])]
    for claim in (_less_fluid, _slower_steps, _much_better):
        claims += [claim(sac, dqn, params) for sac, dqn in product(runs["sac"], runs["dqn"])]
    if rivals:
        claims += [_robust(pgpe, rivals, params) for pgpe in runs["pgpe"]]
        claims += [
            _heavy(pgpe, rivals, random, params)
            for pgpe, random in product(runs["pgpe"], runs["random"])
        ]
    claims += [_parallel(pgpe, params) for pgpe in runs["pgpe"] if pgpe.generation_seconds]
    return claims


def verdict(effect: Estimate, no_effect: float, num_seeds: int, confidence: float) -> str:
    """Return what an effect says of a claim that it lies above `no_effect`.

    Args:
        effect: The effect with its interval.
        no_effect: The value at which the claim would be neither right nor wrong.
        num_seeds: Seeds of each agent compared.
        confidence: Of the interval.
    """
    if enough_seeds(num_seeds, num_seeds, confidence):
        if effect.low > no_effect:
            return "supported"
        if effect.high < no_effect:
            return "refuted"
    return "inconclusive"


def _jumping_pays(dqn: AgentResults, random: AgentResults, params: CompareParams) -> Claim:
    text = f"{dqn.label} learns that jumping pays: it returns more than {random.label}."
    return _pairwise(text, (dqn, random), _returns, "Return", params)


def _less_fluid(sac: AgentResults, dqn: AgentResults, params: CompareParams) -> Claim:
    text = (
        f"{dqn.label} moves less fluidly than {sac.label}: its torques change more from step to "
        "step."
    )
    return _pairwise(
        text, (dqn, sac), lambda agent: agent.quantities["smoothness"], "Torque change", params
    )


def _slower_steps(sac: AgentResults, dqn: AgentResults, params: CompareParams) -> Claim:
    text = f"{sac.label} takes more training time per control step than {dqn.label}."
    return _pairwise(
        text,
        (sac, dqn),
        lambda agent: 1e3 * agent.train_seconds / agent.env_steps,
        "Milliseconds of training per control step",
        params,
    )


def _much_better(sac: AgentResults, dqn: AgentResults, params: CompareParams) -> Claim:
    text = (
        f"{sac.label} ends much better than {dqn.label}: at least {MUCH_BETTER:g} times its return."
    )
    return _pairwise(text, (sac, dqn), _returns, "Return", params, MUCH_BETTER)


def _pairwise(
    text: str,
    agents: tuple[AgentResults, AgentResults],
    measure: Callable[[AgentResults], Array],
    quantity: str,
    params: CompareParams,
    factor: float = 1.0,
) -> Claim:
    """Judge the claim that the first agent's measure exceeds `factor` times the second's."""
    first, second = agents
    effect = probability_of_improvement(measure(first), factor * measure(second), params)
    times = f"{factor:g} times " if factor != 1 else ""
    evidence = (
        f"{quantity}: {first.label} {_iqm(measure(first), params)}, {second.label} "
        f"{_iqm(measure(second), params)}; a seed of {first.label} exceeds {times}one of "
        f"{second.label} with probability {_show(effect, len(first.curves))}"
    )
    return _claim(text, effect, NO_PREFERENCE, evidence, first, params)


def _robust(pgpe: AgentResults, rivals: Sequence[AgentResults], params: CompareParams) -> Claim:
    """Judge by the difference between the rivals' mean coefficient of variation and PGPE's."""

    def excess(own: Array, *others: Array, axis: int = -1) -> Array:
        spreads = [coefficient_of_variation(other, axis=axis) for other in others]
        return np.mean(spreads, axis=0) - coefficient_of_variation(own, axis=axis)

    effect = estimate(excess, [_returns(agent) for agent in (pgpe, *rivals)], params)
    spreads = ", ".join(
        f"{agent.label} {number(coefficient_of_variation(_returns(agent)))}"
        for agent in (pgpe, *rivals)
    )
    return _claim(
        f"{pgpe.label} is robust: its return varies less from seed to seed than other learners'.",
        effect,
        0.0,
        f"Standard deviation over seeds, relative to the mean return: {spreads}; the others' "
        f"mean less that of {pgpe.label}: {_show(effect, len(pgpe.curves))}",
        pgpe,
        params,
    )


def _heavy(
    pgpe: AgentResults,
    rivals: Sequence[AgentResults],
    random: AgentResults,
    params: CompareParams,
) -> Claim:
    """Judge by the control steps up to the first evaluation that shows learning."""
    threshold = HAS_LEARNED * float(interquartile_mean(_returns(random)))
    own = steps_to(pgpe, threshold)
    others = [steps_to(rival, threshold) for rival in rivals]
    effect = mean_pair_score([bounded_pair_scores(*own, *other) for other in others], params)
    steps = ", ".join(
        f"{agent.label} {number(np.median(needed))} "
        f"({reached.sum()} of {len(reached)} seeds got there)"
        for agent, (needed, reached) in zip((pgpe, *rivals), (own, *others), strict=True)
    )
    return _claim(
        f"{pgpe.label} is computationally heavy: it needs more control steps than other learners "
        f"to return more than {HAS_LEARNED:g} times what {random.label} does.",
        effect,
        NO_PREFERENCE,
        f"Median control steps until the return exceeds {number(threshold)}, a seed that never "
        f"got there counting with its whole budget: {steps}; a seed of {pgpe.label} needs more "
        f"than one of another learner with probability {_show(effect, len(pgpe.curves))}",
        pgpe,
        params,
    )


def _parallel(pgpe: AgentResults, params: CompareParams) -> Claim:
    """Judge by the share of the ideal speed-up that all cores bring."""
    cores = max(pgpe.generation_seconds)
    one, all_cores = pgpe.generation_seconds[1], pgpe.generation_seconds[cores]
    share = one / all_cores / cores if cores > 1 else np.full(len(one), PARALLEL)
    effect = estimate(interquartile_mean, [share], params)
    times = ", ".join(
        f"{number(interquartile_mean(seconds))} on {threads}"
        for threads, seconds in pgpe.generation_seconds.items()
    )
    return _claim(
        f"The population of {pgpe.label} parallelises: {cores} threads play a generation with at "
        f"least {PARALLEL:g} of the ideal speed-up.",
        effect,
        PARALLEL,
        f"Seconds a generation by number of threads: {times}; share of the ideal speed-up: "
        f"{_show(effect, len(share))}" + ("" if cores > 1 else ", for this machine has one core"),
        pgpe,
        params,
    )


def _claim(
    text: str,
    effect: Estimate,
    no_effect: float,
    evidence: str,
    agent: AgentResults,
    params: CompareParams,
) -> Claim:
    num_seeds = len(agent.curves)
    seeds = "1 seed" if num_seeds == 1 else f"{num_seeds} seeds"
    basis = f"{seeds} each, {100 * params.confidence:g}% intervals"
    if not enough_seeds(num_seeds, num_seeds, params.confidence):
        basis += ": too few seeds for a verdict"
    return {
        "text": text,
        "verdict": verdict(effect, no_effect, num_seeds, params.confidence),
        "evidence": f"{evidence} ({basis}).",
    }


def _returns(agent: AgentResults) -> Array:
    return agent.quantities["return"]


def _iqm(values: Array, params: CompareParams) -> str:
    return _show(estimate(interquartile_mean, [values], params), len(values))


def _show(effect: Estimate, num_seeds: int) -> str:
    return wording.estimate(effect.value, effect.low, effect.high, num_seeds)
