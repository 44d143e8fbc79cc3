"""Paths of a project's files."""

import hashlib
from pathlib import Path

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, digest, read_bytes, read_json


def home(root: Path) -> Path:
    """Return the project folder, also from one that DVC deletes after `dvc exp run --temp`."""
    root = root.resolve()
    for parent in root.parents:
        if parent.parts[-3:] == (".dvc", "tmp", "exps"):
            return parent.parents[2]
    return root


class SeedPaths:
    """The files that training one seed of an agent writes."""

    def __init__(self, models: Path, number: int, trained: Path) -> None:
        self.owner = (models.name, number)  # the agent and the seed
        self.trained = trained  # digests of the agent's files, when all its seeds are trained
        self.folder = models / f"seed-{number}"
        self.policy = self.folder / "policy.zip"  # the published one
        self.final_policy = self.folder / "final.zip"  # at the end of training
        self.curve = self.folder / "curve.csv"  # the learning curve
        self.validation = self.folder / "validation.csv"  # of what could have been published
        self.files = (self.policy, self.final_policy, self.curve, self.validation)

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of each file, by its name."""
        return {path.name: digest(path) for path in self.files}

    def content(self, path: Path) -> bytes:
        """Return the content of one of the files.

        Raises:
            InputError: There is none, or it is not the one whose digest training has left, which is
                in git, unlike the file itself.
        """
        agent, seed = self.owner
        content = read_bytes(path, f"train@{agent}")
        if self.trained.exists():  # once all seeds are trained
            digests = read_json(self.trained, f"train@{agent}").get(str(seed))
            allowed = digests.get(path.name) if isinstance(digests, dict) else None
            if (given := hashlib.sha256(content).hexdigest()) != allowed:
                raise InputError(
                    f"{path}: given another file than was trained, of SHA-256 {given[:8]}..., "
                    f"allowed: {str(allowed)[:8]}..., as in {self.trained}; `dvc checkout` brings "
                    f"it back, or `dvc repro --force train@{agent}` trains it again"
                )
        return content


class AgentPaths:
    """The files of an agent."""

    def __init__(self, root: Path, name: str) -> None:
        results, media = root / "results" / "agents" / name, root / "media"
        timing = root / "results" / "timing" / name  # what only a clock or the machine tells
        self.models = root / "models" / name  # the folder of its seeds' policies
        self.timing = timing / "timing.csv"  # training seconds at each row of the learning curves
        self.machines = timing / "machines.json"  # that each seed was trained on
        self.training = results / "training.json"  # digests of the files of each seed's training
        self.episodes = results / "episodes.csv"  # every held-out episode
        self.seed_means = results / "seeds.csv"  # of each seed over its held-out episodes
        self.variants = results / "variants.csv"  # means of each seed for other policy versions
        self.metrics = results / "metrics.json"  # means over all held-out episodes
        self.trajectory = results / "trajectory.npz"  # the median episode, state by state
        self.film = media / f"{name}.mp4"  # the median episode as a video
        self.recording = media / f"{name}.rrd"  # the median episode as a Rerun recording
        self.recorded = media / "digests" / f"{name}.json"  # of what is in it, film included

    def seed(self, number: int) -> SeedPaths:
        """Return the files of one seed."""
        return SeedPaths(self.models, number, self.training)


class StudyPaths:
    """The files of a search for an agent's settings; its control, random draws, has its own."""

    def __init__(self, root: Path, agent: str, is_control: bool = False) -> None:
        folder, name = root / "results" / "tuning", agent + ".random" * is_control
        self.study = root / ".tuning" / f"{name}.db"  # Optuna's, if it is in no other storage
        self.trials = folder / f"{name}.csv"  # every trial
        self.summary = folder / f"{name}.json"  # what was found, and the verdict
        self.preset = root / "presets" / f"tuned-{agent}"  # settings that are better


class Paths:
    """The files of a project."""

    def __init__(self, root: Path = PROJECT_ROOT) -> None:
        self.root = root
        self.params = root / "params.yaml"
        self.lock = root / "dvc.lock"  # DVC's record of what the stages read and wrote
        self.inputs = root / ".inputs"  # what stages read besides parameters and stages' results
        self.seconds = root / ".dvc" / "tmp" / "seconds.json"  # of each stage's last run
        self.checked = self.inputs / "checked"  # of `check`; stages that read parameters need it
        self.assets = root / "assets"  # the folder of the robots
        self.physique = self.assets / "robot.json"  # masses and torques, before and after the edits
        self.lineup = root / "media" / "lineup.rrd"  # all agents' median episodes in one recording
        self.lineup_recorded = root / "media" / "digests" / "lineup.json"  # of what is in it
        results = root / "results"
        self.comparison = results / "comparison.json"  # statistics and claims
        self.figures = results / "figures"  # the folder of the pictures for documents
        self.plots = results / "plots"  # the folder of the comparison's tables for `dvc plots`
        self.report = results / "report.html"  # the comparison as one page
        self.robustness = results / "robustness.json"  # what agents keep under perturbations
        self.curves = results / "curves.csv"  # every evaluation of the learning curves
        self.speed = results / "speed.json"  # seconds, and the claims that rest on them
        self.scaling = results / "scaling.csv"  # of a unit of training, by number of threads

    def agent(self, name: str) -> AgentPaths:
        """Return the files of one agent."""
        return AgentPaths(self.root, name)

    def perturbed(self, name: str) -> Path:
        """Return the table of an agent's episodes under perturbations."""
        return self.root / "results" / "robustness" / f"{name}.csv"

    def study(self, name: str, is_control: bool = False) -> StudyPaths:
        """Return the files of a search for an agent's settings."""
        return StudyPaths(self.root, name, is_control)

    def code(self, stage: str) -> Path:
        """Return the digests of the code that a stage runs."""
        return self.inputs / "code" / f"{stage}.json"

    def training_code(self, algorithm: str) -> Path:
        """Return the digests of the code that trains an algorithm's agents."""
        return self.inputs / "train" / algorithm / "code.json"

    def demonstrations(self, algorithm: str) -> Path:
        """Return the demonstrations that an algorithm's agents learn from, if they need any."""
        return self.inputs / "train" / algorithm / "demonstrations.zip"
