"""Where the files of a project lie."""

from dataclasses import dataclass
from pathlib import Path

from jumping_ant.base.files import PROJECT_ROOT


@dataclass(frozen=True)
class SeedPaths:
    """What the training of one seed of an agent leaves.

    Attributes:
        folder: Where it lies.
    """

    folder: Path

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
        """Where it was trained."""
        return self.folder / "machine.json"


@dataclass(frozen=True)
class AgentPaths:
    """What there is of an agent.

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
        return SeedPaths(self.models / f"seed-{number}")

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
        """The same of other versions of the policies."""
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
        """That episode as video."""
        return self.root / "media" / f"{self.name}.mp4"

    @property
    def recording(self) -> Path:
        """That episode as Rerun recording."""
        return self.root / "media" / f"{self.name}.rrd"

    @property
    def _results(self) -> Path:
        return self.root / "results" / "agents" / self.name


@dataclass(frozen=True)
class Paths:
    """What there is of a project.

    Attributes:
        root: Its folder.
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
        """The folder of the same as pictures."""
        return self.root / "results" / "figures"

    @property
    def plots(self) -> Path:
        """The folder of the same as tables for `dvc plots`."""
        return self.root / "results" / "plots"

    @property
    def report(self) -> Path:
        """The comparison as one page."""
        return self.root / "results" / "report.html"
