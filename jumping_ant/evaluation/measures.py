"""The measures of a held-out episode by name (formulas: docs/measures-and-claims.md)."""

from dataclasses import dataclass

from jumping_ant.base.tables import Column


@dataclass(frozen=True)
class Measure:
    """A column of `episodes.csv`."""

    label: str
    unit: str  # empty for pure numbers
    about: str  # what it is, in a sentence
    is_better: int  # 1 where more is better, -1 where less is, 0 where neither
    column: Column = Column()  # the values that it may have

    @property
    def axis(self) -> str:
        """Return the name with its unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label


MEASURES = {
    "return": Measure("Return", "", "Sum of the rewards of an episode.", 1),
    "peak_height": Measure("Peak height", "m", "Greatest height of the torso's centre.", 1),
    "apex": Measure(
        "Apex", "m", "Mean over jumps of the torso centre's greatest height; 0 without a jump.", 1
    ),
    "mean_height": Measure("Mean height", "m", "Mean height of the torso's centre.", 1),
    "jumps": Measure(
        "Jumps", "", "Number of times off the ground for long enough.", 0, Column(low=0)
    ),
    "airborne_seconds": Measure("Airborne", "s", "Time without any contact.", 1, Column(low=0)),
    "flight": Measure(
        "Flight",
        "",
        "Share of the control steps that end without any contact.",
        1,
        Column(low=0, high=1),
    ),
    "torque_change": Measure(
        "Torque change",
        "",
        "Mean squared change of torque over peak torque from step to step; 0 at rest.",
        -1,
        Column(low=0, high=4),
    ),
    "fluidity": Measure(
        "Fluidity",
        "",
        "Spectral arc length of the joints' velocities while they move: closer to 0 is more fluid.",
        1,
        Column(high=0, can_be_empty=True),
    ),
    "work": Measure("Work", "J", "Mechanical work of the motors.", -1, Column(low=0)),
    "drift": Measure(
        "Drift", "m", "Distance of the torso's end from its start, on the floor.", 0, Column(low=0)
    ),
}

TERM = "return_"  # prefix of the columns of the reward's terms


def of_column(column: str) -> Measure | None:
    """Return the measure in a column of `episodes.csv`, None for counts and names."""
    if column.startswith(TERM):
        term = column.removeprefix(TERM).replace("_", " ")
        return Measure(f"Return: {term}", "", f"Share of the term {term} in the return.", 0)
    return MEASURES.get(column)
