"""Paths of a project's files."""

from dataclasses import dataclass
from pathlib import Path

from jumping_ant.base.files import PROJECT_ROOT


def home(root: Path) -> Path:
    """Return the project folder, also from a folder where DVC runs an experiment.

    `dvc exp run --temp` and `--queue` run in `.dvc/tmp/exps/` and delete that folder afterwards.
    """
    root = root.resolve()
    for parent in root.parents:
        if parent.parts[-3:] == (".dvc", "tmp", "exps"):
            return parent.parents[2]
    return root


@dataclass(frozen=True)
class SeedPaths:
    """The files that training one seed of an agent writes.

    Attributes:
        models: The folder of the agent's seeds.
        number: The seed.
    """

    models: Path
    number: int

    @property
    def folder(self) -> Path:
        """The folder that contains them."""
        return self.models / f"seed-{self.number}"

    @property
    def owner(self) -> tuple[str, int]:
        """The agent and the seed that they are of."""
        return self.models.name, self.number

    @property
    def policy(self) -> Path:
        """The published policy."""
        return self.folder / "policy.zip"

    @property
    def final_policy(self) -> Path:
        """The policy at the end of training."""
        return self.folder / "final.zip"

    @property
    def curve(self) -> Path:
        """The learning curve."""
        return self.folder / "curve.csv"

    @property
    def machine(self) -> Path:
        """The machine that it was trained on."""
        return self.folder / "machine.json"


@dataclass(frozen=True)
class AgentPaths:
    """The files of an agent.

    Attributes:
        root: The project's folder.
        name: The agent's name.
    """

    root: Path
    name: str

    @property
    def models(self) -> Path:
        """The folder of its seeds' policies."""
        return self.root / "models" / self.name

    def seed(self, number: int) -> SeedPaths:
        """Return the files of one seed."""
        return SeedPaths(self.models, number)

    @property
    def timing(self) -> Path:
        """Training seconds at each row of the learning curves."""
        return self._results / "timing.csv"

    @property
    def scaling(self) -> Path:
        """Seconds of a unit of training by number of threads."""
        return self._results / "scaling.csv"

    @property
    def episodes(self) -> Path:
        """Every held-out episode."""
        return self._results / "episodes.csv"

    @property
    def seed_means(self) -> Path:
        """Means of each seed over its held-out episodes."""
        return self._results / "seeds.csv"

    @property
    def variants(self) -> Path:
        """Means of each seed for other versions of its policy."""
        return self._results / "variants.csv"

    @property
    def metrics(self) -> Path:
        """Means over all held-out episodes."""
        return self._results / "metrics.json"

    @property
    def trajectory(self) -> Path:
        """The median episode, state by state."""
        return self._results / "trajectory.npz"

    @property
    def film(self) -> Path:
        """The median episode as a video."""
        return self.root / "media" / f"{self.name}.mp4"

    @property
    def recording(self) -> Path:
        """The median episode as a Rerun recording."""
        return self.root / "media" / f"{self.name}.rrd"

    @property
    def _results(self) -> Path:
        return self.root / "results" / "agents" / self.name


@dataclass(frozen=True)
class Paths:
    """The files of a project.

    Attributes:
        root: The project's folder.
    """

    root: Path = PROJECT_ROOT

    def agent(self, name: str) -> AgentPaths:
        """Return the files of one agent."""
        return AgentPaths(self.root, name)

    @property
    def params(self) -> Path:
        """The parameters."""
        return self.root / "params.yaml"

    @property
    def checked(self) -> Path:
        """What `check` writes, on which all stages depend that read parameters."""
        return self.inputs / "checked"

    @property
    def lock(self) -> Path:
        """DVC's record of what the stages read and wrote."""
        return self.root / "dvc.lock"

    @property
    def inputs(self) -> Path:
        """The folder of what stages depend on besides parameters and other stages' results."""
        return self.root / ".inputs"

    def code(self, stage: str) -> Path:
        """Return the digests of the code that a stage runs."""
        return self.inputs / "code" / f"{stage}.json"

    def training_code(self, algorithm: str) -> Path:
        """Return the digests of the code that trains an algorithm's agents."""
        return self.inputs / "train" / algorithm / "code.json"

    def demonstrations(self, algorithm: str) -> Path:
        """Return the demonstrations that an algorithm's agents learn from, if they need any."""
        return self.inputs / "train" / algorithm / "demonstrations.zip"

    @property
    def assets(self) -> Path:
        """The folder of the robots."""
        return self.root / "assets"

    @property
    def physique(self) -> Path:
        """The robot's masses and torques, before and after its edits."""
        return self.assets / "robot.json"

    @property
    def lineup(self) -> Path:
        """All agents' median episodes in one recording."""
        return self.root / "media" / "lineup.rrd"

    @property
    def comparison(self) -> Path:
        """Statistics and claims."""
        return self.root / "results" / "comparison.json"

    @property
    def figures(self) -> Path:
        """The folder of the comparison's figures."""
        return self.root / "results" / "figures"

    @property
    def plots(self) -> Path:
        """The folder of the comparison's tables for `dvc plots`."""
        return self.root / "results" / "plots"

    @property
    def report(self) -> Path:
        """The comparison as one page."""
        return self.root / "results" / "report.html"
