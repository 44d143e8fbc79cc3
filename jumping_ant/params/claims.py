"""Claims: what is expected of agents, as data. `claims/NAME.yaml` holds a list of them.

`jumping_ant.comparison.claims` judges them.
"""

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, RootModel

from jumping_ant.base.errors import InputError
from jumping_ant.params import params_file
from jumping_ant.params.blocks import Block, Positive
from jumping_ant.params.model import Params

NONE = "none"  # the name of no claims
MOST = 200  # claims of a file

Measure = Literal[
    "return",
    "return_at_equal_steps",
    "return_at_equal_seconds",
    "return_of_learned",
    "learned",
    "steps_to_learn",
    "seconds_to_learn",
    "spread",
    "flight",
    "apex",
    "fluidity",
    "retention_world",
    "retention_senses",
    "seconds_per_step",
    "speed_up",
]
Whom = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_. -]*(/[a-z_]+)?$", max_length=90)]


class Claim(Block):
    """A statement that one agent exceeds another in a measure, or falls below it."""

    text: Annotated[str, Field(min_length=1, max_length=300)]
    """The claim in words."""
    statement: str | None = None
    """What the article says, in our words; null for a question of one's own."""
    measure: Measure | Annotated[list[Measure], Field(min_length=2)]
    """What is compared; of several, the claim holds if it does for each."""
    agent: Whom
    """Of which agent it is, or, as in pgpe/final, of which version of its policies."""
    against: Whom
    """The agent or version that it is set against."""
    side: Literal["more", "less"] = "more"
    """Whether the agent is said to have more or less of it."""
    margin: Positive | None = None
    """The smallest difference of practical size; a ratio for control steps and seconds to learn."""

    @property
    def measures(self) -> list[Measure]:
        """Return what is compared, as a list."""
        return self.measure if isinstance(self.measure, list) else [self.measure]


class _Claims(RootModel[Annotated[list[Claim], Field(max_length=MOST)]]):
    """A file of claims."""


def read(path: Path) -> list[Claim]:
    """Read a file of claims; an InputError has a line for each error."""
    return params_file.validated(_Claims, params_file.read(path), path.name).root


def of_project(root: Path, params: Params) -> list[Claim]:
    """Return the claims of a project that its parameters choose.

    Raises:
        InputError: There is no such file, or it does not fit the models, or it names an agent that
            neither the project nor any of its presets has.
    """
    if (name := params.claims) == NONE:
        return []
    path = root / "claims" / f"{name}.yaml"
    if not path.is_file():
        names = [NONE, *sorted(file.stem for file in path.parent.glob("*.yaml"))]
        raise InputError(f"claims: given {name!r}, allowed: {', '.join(names)}")
    claims = read(path)
    known = set(params.agents)
    for preset in (root / "presets").glob("[a-z]*"):
        known |= set(re.findall(r"\bagents\.([a-z0-9_-]+)", preset.read_text(encoding="utf-8")))
    for place, claim in enumerate(claims):
        for key in ("agent", "against"):
            whom = getattr(claim, key).partition("/")[0]
            if whom not in known:
                allowed = ", ".join(sorted(known))
                raise InputError(f"{path.name}: {place}.{key}: given {whom!r}, allowed: {allowed}")
    return claims
