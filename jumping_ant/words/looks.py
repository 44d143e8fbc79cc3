"""How an agent is named and drawn, everywhere alike.

The colours are those of Okabe and Ito, "Color Universal Design", 2008, which people of any colour
vision tell apart; baselines are grey, and told apart by their lines.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREYS = ("#7F7F7F", "#ABABAB")
DASHES = ("--", ":", "-.")
INK = "#333333"
BASELINES = ("random", "open_loop")  # algorithms that learn nothing
LONG_AXIS = 30.0  # values further apart than by this factor get a logarithmic axis
VERDICTS = {"supported": "#00795A", "refuted": "#B4461B", "inconclusive": "#6B7280"}


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of an agent, in matplotlib's words."""

    colour: str
    marker: str
    line: str


def looks(algorithms: Mapping[str, str]) -> dict[str, Look]:
    """Return each agent's look.

    Args:
        algorithms: What each agent runs, by its name, in the order of `params.yaml`.
    """
    learners = [name for name, algorithm in algorithms.items() if not is_baseline(algorithm)]
    drawn = {
        name: Look(COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)], "-")
        for i, name in enumerate(learners)
    }
    baselines = [name for name in algorithms if name not in drawn]
    for i, name in enumerate(baselines):
        grey = GREYS[i // len(DASHES) % len(GREYS)]
        drawn[name] = Look(grey, "x", DASHES[i % len(DASHES)])
    return {name: drawn[name] for name in algorithms}


def label(name: str, algorithm: str) -> str:
    """Return the name to print: an algorithm's acronym in capitals, other names as given."""
    return name.upper() if name == algorithm and not is_baseline(algorithm) else name


def of_sample(label: str, drawn: Mapping[str, Look]) -> Look:
    """Return the look of a sample in a claim: of an agent, or of a version of its policies.

    Args:
        label: `SAC`, or `SAC, rounded`.
        drawn: Looks by the labels of agents.
    """
    return drawn[label.partition(", ")[0]]


def is_long(values: Sequence[float]) -> bool:
    """Return whether values of 1 and more are too far apart for an axis that is not logarithmic."""
    return bool(values) and min(values) >= 1 and max(values) > LONG_AXIS * min(values)


def remark(algorithm: str, robot: str) -> str:
    """Return what sets an agent apart from those that learn on the edited robot, if anything."""
    parts = ["baseline"] if is_baseline(algorithm) else []
    return ", ".join([*parts, *(["unedited robot"] if robot == "unedited" else [])])


def is_baseline(algorithm: str) -> bool:
    """Return whether an algorithm learns nothing."""
    return algorithm in BASELINES
