"""Colours, markers and line styles of agents, and the charts' other colours.

The colours are those of Okabe and Ito, "Color Universal Design", 2008, which people with any colour
vision can tell apart. Each family of algorithms has one of them; its members differ in shade,
marker and line style. Baselines are grey and differ in line style.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from jumping_ant.looks.naming import BASELINE, Family, by_family

COLOURS: dict[Family, str] = {
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
PAIR = "#B0B0B0"  # of the lines between values of the same seed
CHANCES = ("#F4A582", "#F7F7F7", "#7FB6E0")  # of winning: from never to always
VERDICTS = {
    "supported": "#00795A",
    "refuted": "#B4461B",
    "equivalent": "#2B5F9E",
    "inconclusive": "#6B7280",
}


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of an agent, in matplotlib's notation."""

    colour: str
    marker: str
    line: str


def looks(families: Mapping[str, Family]) -> dict[str, Look]:
    """Return each agent's look, which depends on their order, that of `params.yaml`."""
    grouped = by_family(families)
    drawn = {name: _baseline(place) for place, name in enumerate(grouped.pop(BASELINE, []))}
    learners = [(name, family, i) for family, own in grouped.items() for i, name in enumerate(own)]
    for number, (name, family, place) in enumerate(learners):
        line = LINES[place // SHADES_PER_LINE % len(LINES)]
        colour = _mixed(COLOURS[family], SHADES[place % len(SHADES)])
        drawn[name] = Look(colour, MARKERS[number % len(MARKERS)], line)
    return {name: drawn[name] for name in families}


def of_sample(label: str, drawn: Mapping[str, Look]) -> Look:
    """Return the look of a claim's sample, `SAC` or `SAC, rounded`, from those by agent label."""
    return drawn[label.partition(", ")[0]]


def _baseline(place: int) -> Look:
    """Return the look of a baseline by its place among the baselines."""
    return Look(GREYS[place // len(DASHES) % len(GREYS)], "x", DASHES[place % len(DASHES)])


def _mixed(colour: str, shade: float) -> str:
    """Return a colour, mixed with so much white, or black if the shade is below 0."""
    goal = 255 if shade > 0 else 0
    parts = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return "#" + "".join(f"{round(part + abs(shade) * (goal - part)):02X}" for part in parts)
