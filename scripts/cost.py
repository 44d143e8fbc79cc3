"""Estimate what a run will cost: minutes, core-hours and gigabytes.

Usage: python -m scripts.cost [--preset NAME] [--set KEY=VALUE ...] (`make cost`)

Names the stages that DVC would run again, with all that depends on them, and what each takes: of
`make repro`, of `make preset PRESET=NAME`, or of `dvc exp run -S KEY=VALUE`. Nothing is run but the
first stages, in a copy.
"""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from jumping_ant.base import command_line, machine, output
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file, presets
from jumping_ant.experiment.models import Params
from jumping_ant.looks import wording
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from scripts import rates, stale, workload
from scripts.preset import folder_of

COPIES = 3  # of what stages write: in the project, in DVC's cache, and in MLflow's store
MOST_MINUTES = 120
ANT = ("ant", 5)  # robot and frame skip of `workload.STEP`


@dataclass(frozen=True)
class Cost:
    """What a stage will take.

    Attributes:
        stage: Its name.
        algorithm: The algorithm of its agent, or none.
        modelled: Seconds and core-seconds by `scripts.workload`.
        seconds: Seconds on this machine.
        core_seconds: Seconds of all its cores.
        written: Bytes that it writes.
        is_measured: Whether this machine has run it before.
        is_whole: Whether it begins from nothing, so that what it takes tells its rate.
    """

    stage: str
    algorithm: str
    modelled: tuple[float, float]
    seconds: float
    core_seconds: float
    written: float
    is_measured: bool
    is_whole: bool


class Ran(NamedTuple):
    """What a stage took."""

    stage: str
    seconds: float
    core_seconds: float


@dataclass(frozen=True)
class Estimate:
    """What a run will take."""

    costs: list[Cost]
    has_rates: bool
    speed: float

    @property
    def total(self) -> str:
        """Minutes, core-hours and gigabytes."""
        written = sum(cost.written for cost in self.costs)
        return f"{told(self.costs)}, {written / 1e9:.2f} GB written"

    @property
    def whose(self) -> str:
        """Whose rates these are."""
        if not self.has_rates:
            return (
                f"Rates: those of the committed run, times {wording.number(self.speed)}, as for a "
                "control step; what a run takes here will be this machine's own."
            )
        own = sum(cost.is_measured for cost in self.costs)
        others = len(self.costs) - own
        like = f", those most like {others} others" if others else ""
        return f"Rates: this machine's own, of {own} of these stages{like}."

    def compared(self, ran: Sequence[Ran]) -> str:
        """Return how the estimate of stages compares with what they took."""
        names = {one.stage for one in ran}
        estimated = [cost for cost in self.costs if cost.stage in names]
        return f"Estimated {told(estimated)}; took {told(ran)}."

    def told_by(self, ran: Sequence[Ran]) -> dict[str, rates.Took]:
        """Return what stages took that began from nothing, which tells this machine's rates."""
        costs = {cost.stage: cost for cost in self.costs if cost.is_whole}
        return {
            one.stage: rates.Took(cost.algorithm, one.seconds, one.core_seconds, *cost.modelled)
            for one in ran
            if (cost := costs.get(one.stage))
        }


def told(costs: Sequence[Cost | Ran]) -> str:
    """Return minutes, of long runs hours, and core-hours as text."""
    minutes = sum(cost.seconds for cost in costs) / 60
    core_hours = sum(cost.core_seconds for cost in costs) / 3600
    time = f"{minutes / 60:.1f} hours" if minutes > MOST_MINUTES else f"{minutes:.1f} minutes"
    return f"{time}, {core_hours:.2f} core-hours"


def estimate(
    folder: Path, source: Path, params: Params, own: rates.Rates, targets: Sequence[str] = ()
) -> Estimate:
    """Return what the stale stages will take.

    Args:
        folder: Where the first stages have run.
        source: Where checkpoints are; the same folder, but for a copy.
        params: The parameters.
        own: The rates of this machine.
        targets: Stages to run, with those that they need; all by default.
    """
    cores, step = machine.num_cores(), workload.STEP
    stages = stale.look(folder, targets)
    if (params.robot.source, params.env.frame_skip) != ANT and stages:
        other = World(robot.read(folder, "edited"), params.env)
        step *= rates.step_seconds(other) / rates.step_seconds(rates.ant())
    costs, written = [], stale.written(rates.project_of(PROJECT_ROOT) / "dvc.lock")
    for stage in stages:
        kind, _, name = stage.partition("@")
        agent = params.agents.get(name)
        algorithm = agent.algorithm if agent else name
        trained, is_begun = 0, False
        if kind == "train":
            trained, is_begun = stale.trained(folder, source, params, name)
        modelled = workload.load(params, stage, cores, step, trained)
        slower, more, is_measured = own.of(stage, algorithm)
        costs.append(
            Cost(
                stage,
                algorithm,
                modelled,
                slower * modelled[0],
                more * modelled[1],
                COPIES * _size(written, stage) * (len(params.seeds) if kind == "train" else 1),
                is_measured,
                is_whole=not is_begun,
            )
        )
    return Estimate(costs, bool(own), own.speed)


def _size(written: Mapping[str, float], stage: str) -> float:
    """Return what a stage wrote the last time; of a new one, what others of its kind did."""
    kind = stage.partition("@")[0]
    like = [size for name, size in written.items() if name.partition("@")[0] == kind]
    return written.get(stage, sum(like) / max(len(like), 1))


def summary(stages: Iterable[str]) -> str:
    """Return stages in a line: those of agents by their number."""
    counts = Counter(stage.partition("@")[0] for stage in stages)
    return ", ".join(kind if count == 1 else f"{kind} ({count})" for kind, count in counts.items())


def main() -> None:
    """Parse the command line and print the estimate."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--preset", help="name of a file in presets/, run in a folder of its own")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="overrides")
    options = parser.parse_args()
    preset = presets.load(options.preset) if options.preset else None
    show(folder_of(options.preset) if preset else PROJECT_ROOT, preset, options.set)


def show(source: Path, params: Params | None, overrides: Sequence[str]) -> None:
    """Print the estimate of a run whose results would be added to a folder's."""
    with stale.shadow(source, params, overrides) as folder:  # imports DVC, which sets its level
        logging.getLogger("dvc").setLevel(logging.WARNING)  # else it tells of the copy's stages
        asked, own = params_file.load(folder / "params.yaml"), rates.Rates()
        found = estimate(folder, source, asked, own)
    for cost in found.costs:
        print(f"{cost.stage:32} {told([cost])}, {cost.written / 1e6:.1f} MB")
    print(
        f"{len(found.costs)} stages: {found.total}, on {machine.num_cores()} cores.\n{found.whose}"
    )


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
