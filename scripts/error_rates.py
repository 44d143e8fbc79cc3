"""Measure how often the rule of verdicts errs, and how often its intervals hold the truth.

Usage: python -m scripts.error_rates

Simulates families of claims, pairs of agents and samples of seeds, and writes the shares into
docs/claims.md. Takes about a minute. Seeds are drawn from three distributions and from the
published returns of DQN, SAC and PGPE, with some noise (a smoothed bootstrap).
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from jumping_ant.base import command_line
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.comparison import estimates, hypothesis_tests
from jumping_ant.comparison.estimates import Estimate
from jumping_ant.comparison.hypothesis_tests import (
    equivalence,
    excess_spread_test,
    rank_test,
    sign_test,
    spread_test,
)
from jumping_ant.comparison.step_down import adjust
from jumping_ant.experiment import episodes, params_file
from scripts.publish import DOCS, replace_section

Array = NDArray[np.float64]
Draw = Callable[[tuple[int, ...]], Array]

LEVEL = 0.05
NUM_SEEDS = 16
NUM_CLAIMS, NUM_MARGINS = 20, 8
ARRANGEMENTS = 999  # of a test; as valid as more of them, but faster
FAMILIES = 4000
REPEATS = 1000  # of tests
SAMPLES = 20_000  # of intervals that a formula gives
RESAMPLES = 400  # of intervals that a bootstrap gives
POPULATION = 10**6  # draws that stand for a whole distribution: what is true
CENTRE = 10.0  # about the median of the samples, which spread by about 1
NOISE = 0.3  # [standard deviations] of the smoothed bootstrap
STRETCH = 3.0  # ratio of unequal spreads
GRIDS = {  # control steps between evaluations: those of PGPE and DQN
    "8 evaluations each": (55_000.0, 26_250.0),
    "16 evaluations each": (27_500.0, 13_125.0),
}
ONSET = 60_000.0, 20_000.0  # [control steps] mean and deviation


def main() -> None:
    """Parse the command line, simulate and write."""
    command_line.parser(__doc__).parse_args()
    hypothesis_tests.MOST = ARRANGEMENTS
    replace_section(DOCS / "claims.md", "error rates", "\n\n".join(tables()))


def tables() -> Iterator[str]:
    """Yield the tables, as Markdown."""
    yield table(["families of 20 claims", "this rule", "Holm"], families())
    sources = shapes(np.random.default_rng(0))
    yield table(["test at the 5 % level, no difference", *sources], false_alarms(sources))
    yield table(["95 % interval", *sources], coverage(sources))


def table(head: Sequence[str], rows: Iterator[tuple[str, list[float]]]) -> str:
    """Return shares as a table in Markdown."""
    lines = [head, ["---"] * len(head)]
    lines += [[name, *(f"{share:.3f}" for share in shares)] for name, shares in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def shapes(generator: np.random.Generator) -> dict[str, Draw]:
    """Return what draws deviations of seeds from `CENTRE`, by kind.

    `CENTRE` is their median, except that failures pull theirs 0.096 below it.
    """
    params = params_file.load()
    published = []
    for name in ("dqn", "sac", "pgpe"):
        returns = episodes.read_means(PROJECT_ROOT, params, name)["return"]
        published.append((returns - np.median(returns)) / returns.std(ddof=1))
    known = np.concatenate(published)

    def failures(shape: tuple[int, ...]) -> Array:
        return np.where(generator.random(shape) < 0.2, -3.5, 0.0) + generator.normal(0, 0.3, shape)

    def resampled(shape: tuple[int, ...]) -> Array:
        return generator.choice(known, shape) + generator.normal(0, NOISE, shape)

    return {
        "normal": lambda shape: generator.normal(0.0, 1.0, shape),
        "lognormal": lambda shape: generator.lognormal(0.0, 0.5, shape) - 1.0,
        "a fifth of failures": failures,
        "published seeds": resampled,
    }


def families() -> Iterator[tuple[str, list[float]]]:
    """Yield the share of families with a false verdict, in the worst of several margins.

    Effects and margins are in standard errors. The second share is that of Holm's procedure on the
    smaller of each claim's two p values, which is not valid.
    """
    has_margin = np.arange(NUM_CLAIMS) < NUM_MARGINS
    odd = np.arange(NUM_CLAIMS) % 2 == 1
    for name, small, others in (
        ("nothing differs", 0.0, 0.0),
        ("the claims with margins lie at them, the others differ by nothing", 1.0, 0.0),
        ("the claims with margins lie at them, the others differ by much", 1.0, 30.0),
        ("the claims with margins differ by nothing, the others by much", 0.0, 30.0),
        ("half of the claims with margins lie at them, the others differ by much", odd, 30.0),
    ):
        rates = []
        for margin in (2.0, 3.0, 4.0, 6.0):
            effects = np.where(has_margin, small * margin, others)
            rates.append(_false_verdicts(effects, margin, has_margin))
        yield name, np.max(rates, axis=0).tolist()


def _false_verdicts(effects: Array, margin: float, has_margin: NDArray[np.bool_]) -> list[float]:
    """Return the shares for claims with such effects, by this rule and by Holm's."""
    generator = np.random.default_rng(11)
    found = effects + generator.standard_normal((FAMILIES, NUM_CLAIMS))
    differs = 2 * stats.norm.sf(np.abs(found))
    outside = np.maximum(stats.norm.sf(found + margin), stats.norm.cdf(found - margin))
    outside[:, ~has_margin] = np.inf
    # A difference is false where there is none, or on the wrong side.
    no_difference = (effects == 0) | (np.sign(found) != np.sign(effects))
    no_equivalence = np.broadcast_to(effects >= margin, found.shape)
    smaller = np.minimum(differs, outside)
    wrong = np.where(outside < differs, no_equivalence, no_difference)
    ours, holms = 0, 0
    for i, pair in enumerate(zip(differs, outside, strict=True)):
        own = adjust([(p, q if q < np.inf else None) for p, q in zip(*pair, strict=True)])
        ours += any(
            (one.difference <= LEVEL and no_difference[i, j])
            or (one.equivalence is not None and one.equivalence <= LEVEL and no_equivalence[i, j])
            for j, one in enumerate(own)
        )
        holm = adjust([(p, None) for p in smaller[i]])
        holms += any(one.difference <= LEVEL and wrong[i, j] for j, one in enumerate(holm))
    return [ours / FAMILIES, holms / FAMILIES]


def false_alarms(sources: dict[str, Draw]) -> Iterator[tuple[str, list[float]]]:
    """Yield how often each test at `LEVEL` finds what is not there."""
    rank, sign = partial(rank_test, seed=0), partial(sign_test, seed=0)
    spread = partial(spread_test, seed=0)

    def pairs(draw: Draw, stretch: float = 1.0) -> list[Array]:
        samples = draw((REPEATS, 2, NUM_SEEDS))
        samples[:, 1] *= stretch
        return list(CENTRE + samples)

    def row(
        name: str, test: Callable[[Array, Array], float], stretch: float = 1.0
    ) -> tuple[str, list[float]]:
        found = [[test(*pair) for pair in pairs(draw, stretch)] for draw in sources.values()]
        return name, (np.array(found) <= LEVEL).mean(axis=1).tolist()

    yield row("rank test", rank)
    yield row(f"rank test, one agent spreads {STRETCH:g} times as much", rank, STRETCH)
    yield row("sign-flip test", lambda x, y: sign(x - y))
    yield row("relative spread, of 7 times the median", lambda x, y: spread(x, 7 * y))
    yield row(
        "equivalence by ranks, at the margin",
        lambda x, y: equivalence(lambda bound, side: rank(x + 1, y + bound, side=side), -1, 1),
    )
    yield row(
        "equivalence by signs, at the margin",
        lambda x, y: equivalence(lambda bound, side: sign(x + 1 - y - bound, side=side), -1, 1),
    )
    yield (
        "equivalence of spreads, at the margin",
        [_equal_spreads(pairs(draw, STRETCH), true_excess(draw)) for draw in sources.values()],
    )
    for name, steps in GRIDS.items():
        yield (
            f"rank test with bounds, {name}",
            [_onsets(draw, steps, rank) for draw in sources.values()],
        )


def true_excess(draw: Draw) -> float:
    """Return by how much the relative spread of the agent that spreads more exceeds the other's.

    That of their distributions: small samples spread less, and a margin at the mean of their
    differences would hide this bias.
    """
    deviations = draw((POPULATION,))
    one, other = (
        float(estimates.relative_spread(CENTRE + stretch * deviations)) for stretch in (1, STRETCH)
    )
    return other - one


def _equal_spreads(pairs: list[Array], edge: float) -> float:
    found = [equivalence(partial(excess_spread_test, y, x), -edge, edge) for x, y in pairs]
    return float(np.mean(np.array(found) <= LEVEL))


def _onsets(draw: Draw, steps: tuple[float, float], test: Callable[..., float]) -> float:
    mean, deviation = ONSET
    found = []
    for pair in np.maximum(mean + deviation * draw((REPEATS, 2, NUM_SEEDS)), 1.0):
        x, y = (
            np.stack([step * (np.ceil(own / step) - 1), step * np.ceil(own / step)], axis=1)
            for own, step in zip(pair, steps, strict=True)
        )
        found.append(test(x, y))
    return float(np.mean(np.array(found) <= LEVEL))


def coverage(sources: dict[str, Draw]) -> Iterator[tuple[str, list[float]]]:
    """Yield how often each interval holds the truth."""
    params = params_file.load().compare
    fewer = params.model_copy(update={"bootstrap_samples": RESAMPLES})
    truths: dict[str, tuple[Callable[..., Estimate], Callable[[Array], float]]] = {
        "interquartile mean": (estimates.estimate_iqm, lambda x: float(stats.trim_mean(x, 0.25))),
        "mean": (estimates.estimate_mean, lambda x: float(x.mean())),
    }
    for name, (interval, truth) in truths.items():
        shares = []
        for draw in sources.values():
            found = interval(CENTRE + draw((SAMPLES, NUM_SEEDS)), params.confidence)
            shares.append(_covered(found, truth(CENTRE + draw((POPULATION,)))))
        yield f"{name} (Student's t)", shares

    def excess(x: Array, y: Array, axis: int = -1) -> Array:
        return estimates.relative_spread(y, axis) - estimates.relative_spread(x, axis)

    differences: dict[str, Callable[..., Array]] = {
        "median difference of pairs": estimates.pairwise_median(np.subtract),
        "difference in relative spread": excess,
    }
    for name, statistic in differences.items():
        shares = []
        for draw in sources.values():
            samples = CENTRE + draw((RESAMPLES, 2, NUM_SEEDS))
            intervals = [estimates.estimate(statistic, pair, fewer) for pair in samples]
            shares.append(float(np.mean([_covered(own, 0.0) for own in intervals])))
        yield f"{name} (percentile bootstrap)", shares


def _covered(found: Estimate, truth: float) -> float:
    """Return the share of intervals that hold the truth."""
    return float(np.mean((found.low <= truth) & (truth <= found.high)))


if __name__ == "__main__":
    with reported():
        main()
