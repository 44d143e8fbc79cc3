"""Families of algorithms."""

from collections.abc import Mapping
from typing import Literal, get_args

Family = Literal[  # in the order in which families are shown
    "value-based",
    "off-policy actor-critic",
    "on-policy actor-critic",
    "evolution",
    "imitation",
    "baseline",
]
BASELINE: Family = "baseline"


def by_family(families: Mapping[str, Family]) -> dict[Family, list[str]]:
    """Return the members of each family that has any, baselines last; members keep their order."""
    members: dict[Family, list[str]] = {
        family: [name for name, own in families.items() if own == family]
        for family in get_args(Family)
    }
    return {family: names for family, names in members.items() if names}
