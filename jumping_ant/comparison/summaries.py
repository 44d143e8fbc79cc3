"""The summaries of `compare` and `timing`, `comparison.json` and `speed.json`, as one.

What is equal on every machine and what a clock tells are in files of their own.
"""

from collections.abc import Mapping
from typing import Any

Summary = Mapping[str, Any]


def merged(compared: Summary, timed: Summary) -> dict[str, Any]:
    """Return both: each agent's numbers together, and the claims of one after those of the other.

    Either may be empty.
    """
    agents, costs = compared.get("agents", {}), timed.get("agents", {})
    claims = [*compared.get("claims", []), *timed.get("claims", [])]
    together = {name: own | costs.get(name, {}) for name, own in agents.items()}
    return {**compared, **timed, "agents": together, "claims": claims} if compared else {}


def deciding_p(claim: Mapping[str, Any]) -> float:
    """Return the adjusted p value by which a claim is decided, or is not."""
    if claim["verdict"] == "equivalent":
        return float(claim["p_equivalence_adjusted"])
    return float(claim["p_adjusted"])
