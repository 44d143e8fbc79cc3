"""Colours, markers and line styles of agents, the same in all output.

The colours are those of Okabe and Ito, "Color Universal Design", 2008, which people with any colour
vision can tell apart. Each family of algorithms has one of them; its members differ in shade,
marker and line style. Baselines are grey and differ in line style.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

Family = Literal[
    "value-based",
    "off-policy actor-critic",
    "on-policy actor-critic",
    "evolution",
    "imitation",
    "baseline",
]
BASELINE: Family = "baseline"
COLOURS: dict[Family, str] = {  # in the order in which families are shown
    "value-based": "#0072B2",
    "off-policy actor-critic": "#D55E00",
    "on-policy actor-critic": "#CC79A7",
    "evolution": "#009E73",
    "imitation": "#E69F00",
    "baseline": "#7F7F7F",
}
# Shades of a family's members, towards white above 0 and towards black below. The first three are
# far apart; the next ones have another line style.
SHADES = (0.0, 0.45, -0.4, 0.22, -0.2, 0.34, -0.55, 0.1)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LINES = ("-", "--", "-.")
SHADES_PER_LINE = 3
GREYS = (COLOURS[BASELINE], "#ABABAB")
DASHES = ("--", ":", "-.")
INK = "#333333"
MOST_IN_A_PANEL = 6  # learners whose curves one panel can show
CHANCES = ("#F4A582", "#F7F7F7", "#7FB6E0")  # of winning: from never to always
MOST_IN_A_WIDE_MATRIX = 8  # agents whose pairs have room for their intervals
LONG_AXIS = 30.0  # values that differ by more than this factor get a logarithmic axis
VERDICTS = {"supported": "#00795A", "refuted": "#B4461B", "inconclusive": "#6B7280"}


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of an agent, in matplotlib's notation."""

    colour: str
    marker: str
    line: str


def looks(families: Mapping[str, Family]) -> dict[str, Look]:
    """Return each agent's look.

    Args:
        families: Each agent's family, by name, in the order of `params.yaml`.
    """
    grouped = by_family(families)
    drawn = {name: _baseline(place) for place, name in enumerate(grouped.pop(BASELINE, []))}
    learners = [(name, family, i) for family, own in grouped.items() for i, name in enumerate(own)]
    for number, (name, family, place) in enumerate(learners):
        line = LINES[place // SHADES_PER_LINE % len(LINES)]
        colour = _mixed(COLOURS[family], SHADES[place % len(SHADES)])
        drawn[name] = Look(colour, MARKERS[number % len(MARKERS)], line)
    return {name: drawn[name] for name in families}


def by_family(families: Mapping[str, Family]) -> dict[Family, list[str]]:
    """Return the members of each family that has any, baselines last.

    Args:
        families: Each agent's family, by name; members keep this order.
    """
    members = {
        family: [name for name, own in families.items() if own == family] for family in COLOURS
    }
    return {family: names for family, names in members.items() if names}


def is_crowded(families: Mapping[str, Family]) -> bool:
    """Return whether there are too many learners for one panel, so that families are apart."""
    return sum(family != BASELINE for family in families.values()) > MOST_IN_A_PANEL


def panels(families: Mapping[str, Family]) -> dict[str, list[str]]:
    """Return the agents of each panel of curves, by its title.

    Args:
        families: Each agent's family, by name.

    Returns:
        One untitled panel of all agents; if there are many learners, a panel for each family, which
        all baselines share.
    """
    if not is_crowded(families):
        return {"": list(families)}
    grouped = by_family(families)
    baselines = grouped.pop(BASELINE, [])
    return {family: [*baselines, *members] for family, members in grouped.items()}


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


def _baseline(place: int) -> Look:
    """Return the look of a baseline by its place among the baselines."""
    return Look(GREYS[place // len(DASHES) % len(GREYS)], "x", DASHES[place % len(DASHES)])


def _mixed(colour: str, shade: float) -> str:
    """Return a colour, mixed with so much white, or black if the shade is below 0."""
    goal = 255 if shade > 0 else 0
    parts = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return "#" + "".join(f"{round(part + abs(shade) * (goal - part)):02X}" for part in parts)
