"""Names of families, and remarks on agents, the same in all output."""

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


def remark(is_baseline: bool, robot: str) -> str:
    """Return how an agent differs from those that learn on the edited robot, if it does."""
    parts = ["baseline"] if is_baseline else []
    return ", ".join([*parts, *(["unedited robot"] if robot == "unedited" else [])])


def by_family(families: Mapping[str, Family]) -> dict[Family, list[str]]:
    """Return the members of each family that has any, baselines last; members keep their order."""
    members: dict[Family, list[str]] = {
        family: [name for name, own in families.items() if own == family]
        for family in get_args(Family)
    }
    return {family: names for family, names in members.items() if names}
