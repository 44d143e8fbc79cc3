"""Names, colours, markers and line styles of agents, the same in all output.

The colours are those of Okabe and Ito, "Color Universal Design", 2008, which people with any colour
vision can tell apart; baselines are grey and differ in line style.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREYS = ("#7F7F7F", "#ABABAB")
DASHES = ("--", ":", "-.")
INK = "#333333"
LONG_AXIS = 30.0  # values that differ by more than this factor get a logarithmic axis
VERDICTS = {"supported": "#00795A", "refuted": "#B4461B", "inconclusive": "#6B7280"}


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of an agent, in matplotlib's notation."""

    colour: str
    marker: str
    line: str


def looks(baselines: Mapping[str, bool]) -> dict[str, Look]:
    """Return each agent's look.

    Args:
        baselines: Whether each agent is a baseline, by name, in the order of `params.yaml`.
    """
    learners = [name for name, is_baseline in baselines.items() if not is_baseline]
    drawn = {
        name: Look(COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)], "-")
        for i, name in enumerate(learners)
    }
    for i, name in enumerate(name for name in baselines if name not in drawn):
        grey = GREYS[i // len(DASHES) % len(GREYS)]
        drawn[name] = Look(grey, "x", DASHES[i % len(DASHES)])
    return {name: drawn[name] for name in baselines}


def label(name: str, algorithm: str, is_baseline: bool) -> str:
    """Return the name to print: an algorithm's acronym in capitals, other names as given."""
    return name.upper() if name == algorithm and not is_baseline else name


def of_sample(label: str, drawn: Mapping[str, Look]) -> Look:
    """Return the look of a sample in a claim: an agent, or a version of its policies.

    Args:
        label: `SAC`, or `SAC, rounded`.
        drawn: Looks by agent label.
    """
    return drawn[label.partition(", ")[0]]


def is_long(values: Sequence[float]) -> bool:
    """Return whether values are all at least 1 and too far apart for a linear axis."""
    return bool(values) and min(values) >= 1 and max(values) > LONG_AXIS * min(values)


def remark(is_baseline: bool, robot: str) -> str:
    """Return how an agent differs from those that learn on the edited robot, if it does."""
    parts = ["baseline"] if is_baseline else []
    return ", ".join([*parts, *(["unedited robot"] if robot == "unedited" else [])])
