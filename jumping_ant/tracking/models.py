"""Policies as MLflow models: logged, registered, the best in validation named champion."""

import functools
import importlib.metadata
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import mlflow.pyfunc
import numpy as np
from mlflow.entities import LoggedModel, LoggedModelOutput, Run
from mlflow.entities.model_registry import ModelVersion
from mlflow.models import Model, ModelSignature
from mlflow.types import Schema, TensorSpec

from jumping_ant.base.files import CODE_ROOT
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Interface
from jumping_ant.tracking import internals, pages
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.records import SeedRecord
from jumping_ant.tracking.store import Store

CHAMPION = "champion"
ABOUT = (
    "A jumping robot: observations in, torques over peak torque out, a row each. Hold each "
    "output for as many control steps as the version's tag `hold` says, then ask for the next one. "
    "`champion` is the seed whose policy did best in validation, not on the held-out episodes."
)
PACKAGE_DIR = CODE_ROOT / "jumping_ant"
CODE = PACKAGE_DIR / "tracking" / "serving.py"
# What `jumping_ant.tracking.serving` and all it imports need.
REQUIREMENTS = ("mlflow", "numpy", "pydantic")


def registered_name(agent: str) -> str:
    """Return the name of an agent's registered model."""
    return f"jumping-ant-{agent}"


class AgentModels:
    """The policies of one agent, as versions of its registered model."""

    def __init__(self, store: Store, agent: str) -> None:
        self._client, self._store = store.client, store
        self._name = registered_name(agent)
        found = self._client.search_registered_models(f"name = '{self._name}'")
        if not found:
            self._client.create_registered_model(self._name, description=ABOUT)
        self._aliases = {name: str(it) for name, it in found[0].aliases.items()} if found else {}
        self._versions = self._client.search_model_versions(f"name = '{self._name}'")
        self._models = store.logged_models(agent)
        self._scores: dict[str, float] = {}  # validation returns by version

    def has(self, run: Run) -> bool:
        """Tell whether a run has a model that is registered, and whose files are there."""
        version = self._version(run)
        ready = {model.model_id for model in self._models if str(model.status) == "READY"}
        if version is None or _model_id(version) not in ready:
            return False
        listed = self._client.list_logged_model_artifacts(_model_id(version))
        return "MLmodel" in {entry.path for entry in listed}

    def log(self, record: SeedRecord, run: Run) -> str:
        """Log and register the model of a new run, and return its id."""
        commit = self._store.commit
        tags, note = _origin_tags(record, commit), record.describe(commit)
        model = self._client.create_logged_model(
            *(self._store.experiment_id, record.name, run.info.run_id),
            tags | stores.source_tags(record.stage, commit) | {pages.NOTE: note},
            record.params,
        )
        _upload(self._store, record, model)
        outputs = [LoggedModelOutput(model.model_id, step=0)]
        self._client.log_outputs(run.info.run_id, outputs)  # show it in the run
        version = self._client.create_model_version(
            *(self._name, f"models:/{model.model_id}", run.info.run_id),
            tags=tags,
            description=note,
            model_id=model.model_id,
        )
        link = internals.registered_tag(self._name, version.version)
        self._client.set_logged_model_tags(model.model_id, link)
        self._versions.append(version)
        return str(model.model_id)

    def settle(self, record: SeedRecord, run: Run, others: Sequence[Run]) -> None:
        """Keep a policy's model of this run and of these others, whose parameters differ.

        Aliases that a user gave to a deleted version, such as `production`, move to this run's.
        """
        own, kept = self._version(run), {it.info.run_id for it in (run, *others)}
        if own is not None and record.validation_return is not None:
            self._scores[str(own.version)] = record.validation_return
        policy = _policy_tags(record).items()
        for version in self._versions:
            if version.run_id in kept or not policy <= version.tags.items():
                continue
            for alias, named in self._aliases.items():
                if own is not None and named == str(version.version):
                    self._client.set_registered_model_alias(self._name, alias, own.version)
                    self._aliases[alias] = str(own.version)
            self._client.delete_model_version(self._name, version.version)
        for model in self._models:
            if model.source_run_id not in kept and policy <= model.tags.items():
                self._client.delete_logged_model(model.model_id)

    def crown(self) -> str | None:
        """Point `champion` at the version that did best in validation; say so.

        Held-out episodes only judge: a champion chosen by them would look better than it is.
        """
        best = max(self._scores, key=lambda it: self._scores[it], default=None)
        if best is None or best == self._aliases.get(CHAMPION):
            return None
        self._client.set_registered_model_alias(self._name, CHAMPION, best)
        score = self._scores[best]
        return f"{self._name}: {CHAMPION} is version {best}, validation return {score:.1f}"

    def _version(self, run: Run) -> ModelVersion | None:
        return next((it for it in self._versions if it.run_id == run.info.run_id), None)


def _model_id(version: ModelVersion) -> str:
    return str(version.source).removeprefix("models:/")


def _upload(store: Store, record: SeedRecord, model: LoggedModel) -> None:
    interface = policy_file.read_interface(record.policy_path, (record.agent, record.seed))
    with tempfile.TemporaryDirectory() as folder:
        path, policy = Path(folder) / "model", Path(folder) / record.policy_path.name
        shutil.copyfile(record.policy_path, policy)  # MLflow refuses links, as DVC's cache may make
        mlflow.pyfunc.save_model(
            path,
            python_model=str(CODE),
            artifacts={"policy": str(policy)},
            code_paths=[str(PACKAGE_DIR)],
            signature=_signature(interface),
            input_example=np.zeros((1, interface.num_observations or 1)),
            pip_requirements=_requirements(),
            mlflow_model=Model(
                artifact_path=model.artifact_location,
                run_id=model.source_run_id,
                model_uuid=model.model_id,
                model_id=model.model_id,
            ),
        )
        store.client.log_model_artifacts(model.model_id, str(path))
    store.client.finalize_logged_model(model.model_id, "READY")


def _signature(interface: Interface) -> ModelSignature:
    """Return the model's inputs and outputs: batches of any size, of any width if unused."""
    width = interface.num_observations or -1
    return ModelSignature(
        inputs=Schema([TensorSpec(np.dtype(np.float64), (-1, width))]),
        outputs=Schema([TensorSpec(np.dtype(np.float64), (-1, interface.num_motors))]),
    )


@functools.cache
def _requirements() -> list[str]:
    """Return the installed versions, without a suffix such as +cpu that no index knows."""
    return [
        f"{name}=={importlib.metadata.version(name).partition('+')[0]}" for name in REQUIREMENTS
    ]


def _policy_tags(record: SeedRecord) -> dict[str, str]:
    """Return the tags that a policy's model and version are found by."""
    return {
        stores.AGENT: record.agent,
        stores.SEED: str(record.seed),
        stores.POLICY_DIGEST: record.digest,
    }


def _origin_tags(record: SeedRecord, commit: str | None) -> dict[str, str]:
    """Return the tags that lead back to the code, the pipeline and the file."""
    tags = {
        stores.ALGORITHM: record.algorithm,
        stores.DVC_STAGE: record.stage,
        stores.DVC_MD5: record.md5,
    }
    tags |= {stores.GIT_COMMIT: commit} if commit else {}
    return _policy_tags(record) | tags | {stores.HOLD: str(record.hold)}
