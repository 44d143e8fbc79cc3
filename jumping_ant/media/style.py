"""How agents and numbers look, the same in all output.

The colours are those of Okabe and Ito, "Color Universal Design", 2008, which people with any colour
vision can tell apart. Each family of algorithms has one of them; its members differ in shade,
marker and line style. Baselines are grey and differ in line style.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import SupportsFloat

from jumping_ant.agents.families import BASELINE, Family, by_family

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
MOST_IN_A_PANEL = 6  # learners whose curves one panel can show


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of an agent, in matplotlib's notation."""

    colour: str
    marker: str
    line: str


def looks(families: Mapping[str, Family]) -> dict[str, Look]:
    """Return each agent's look, which depends on their order, that of `params.yaml`."""
    grouped = by_family(families)
    drawn = {
        name: Look(GREYS[i // len(DASHES) % len(GREYS)], "x", DASHES[i % len(DASHES)])
        for i, name in enumerate(grouped.pop(BASELINE, []))
    }
    learners = [
        (name, family, i) for family, names in grouped.items() for i, name in enumerate(names)
    ]
    for number, (name, family, place) in enumerate(learners):
        line = LINES[place // SHADES_PER_LINE % len(LINES)]
        colour = _mixed(COLOURS[family], SHADES[place % len(SHADES)])
        drawn[name] = Look(colour, MARKERS[number % len(MARKERS)], line)
    return {name: drawn[name] for name in families}


def is_crowded(families: Mapping[str, Family]) -> bool:
    """Return whether there are too many learners for one panel, so that families are apart."""
    return sum(family != BASELINE for family in families.values()) > MOST_IN_A_PANEL


def panels(families: Mapping[str, Family]) -> dict[str, list[str]]:
    """Return the agents of each panel of curves, by its title; each family's has the baselines."""
    if not is_crowded(families):
        return {"": list(families)}
    grouped = by_family(families)
    baselines = grouped.pop(BASELINE, [])
    return {family: [*baselines, *members] for family, members in grouped.items()}


def remark(is_baseline: bool, robot: str) -> str:
    """Return how an agent differs from those that learn on the edited robot, if it does."""
    return ", ".join(["baseline"] * is_baseline + ["unedited robot"] * (robot == "unedited"))


def number(value: SupportsFloat) -> str:
    """Return a number in readable form: 12,345, 123, 1.23, 0.00123."""
    exact = float(value)
    return f"{exact:,.0f}" if abs(exact) >= 100 else f"{exact:.3g}"


def interval(low: SupportsFloat, high: SupportsFloat, num_seeds: int) -> str:
    """Return an interval over seeds in readable form, [0.5, 1,230]; empty for one seed."""
    return f"[{number(low)}, {number(high)}]" if num_seeds > 1 else ""


def estimate(value: SupportsFloat, low: SupportsFloat, high: SupportsFloat, num_seeds: int) -> str:
    """Return a number with its interval over seeds: 12.3 [4.56, 78.9]."""
    return f"{number(value)} {interval(low, high, num_seeds)}".rstrip()


def percent(share: SupportsFloat) -> str:
    """Return a share in per cent, without the sign: 83."""
    return f"{100 * float(share):.0f}"


def percents(low: SupportsFloat, high: SupportsFloat) -> str:
    """Return an interval of a share in per cent, without the sign: 59-100."""
    return f"{percent(low)}\u2013{percent(high)}"


def p_value(value: SupportsFloat) -> str:
    """Return a p-value in readable form: 0.0023."""
    return f"{float(value):.2g}"


def _mixed(colour: str, shade: float) -> str:
    """Return a colour, mixed with so much white, or black if the shade is below 0."""
    goal = 255 if shade > 0 else 0
    parts = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return "#" + "".join(f"{round(part + abs(shade) * (goal - part)):02X}" for part in parts)
