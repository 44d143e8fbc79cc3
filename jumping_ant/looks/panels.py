"""Panels of curves: one of all agents, or one for each family of many learners."""

from collections.abc import Mapping

from jumping_ant.looks.naming import BASELINE, Family, by_family

MOST_IN_A_PANEL = 6  # learners whose curves one panel can show


def is_crowded(families: Mapping[str, Family]) -> bool:
    """Return whether there are too many learners for one panel, so that families are apart."""
    return sum(family != BASELINE for family in families.values()) > MOST_IN_A_PANEL


def panels(families: Mapping[str, Family]) -> dict[str, list[str]]:
    """Return the agents of each panel, by its title; all families' panels share the baselines."""
    if not is_crowded(families):
        return {"": list(families)}
    grouped = by_family(families)
    baselines = grouped.pop(BASELINE, [])
    return {family: [*baselines, *members] for family, members in grouped.items()}
