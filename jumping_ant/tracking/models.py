"""Policies as MLflow models: logged, registered, the best in validation named champion."""

import functools
import importlib.metadata
import shutil
import tempfile
from pathlib import Path

import mlflow.pyfunc
import numpy as np
from mlflow.entities import LoggedModel, LoggedModelOutput, Run
from mlflow.entities.model_registry import ModelVersion
from mlflow.models import Model, ModelSignature
from mlflow.types import Schema, TensorSpec

from jumping_ant.base.files import CODE_ROOT, folder_digest
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Interface
from jumping_ant.tracking import internals, pages
from jumping_ant.tracking.records import SeedRecord
from jumping_ant.tracking.store import (
    AGENT,
    ALGORITHM,
    DVC_MD5,
    DVC_STAGE,
    GIT_COMMIT,
    HOLD,
    POLICY_DIGEST,
    SEED,
    Store,
    changed,
    source_tags,
)

CHAMPION = "champion"
FILES_DIGEST = "files_digest"  # tag of a model: digest of all its files
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
        self._store = store
        self._name = registered_name(agent)
        self._champion = self._find_champion()
        self._models = store.logged_models(agent)
        self._known = store.client.search_model_versions(f"name = '{self._name}'")
        self._mirrored: list[tuple[SeedRecord, ModelVersion]] = []

    def mirror(self, record: SeedRecord, run: Run) -> tuple[LoggedModel, dict[str, int]]:
        """Log, register and describe a policy, as needed; count the changes by kind."""
        client = self._store.client
        model = self._find_model(record)
        is_whole = model is not None and _is_whole(self._store, model, record)
        if model is None or not is_whole:
            model = _log(self._store, record, run, model)
        outputs = run.outputs.model_outputs if run.outputs else []
        if model.model_id not in {output.model_id for output in outputs}:  # show it in the run
            client.log_outputs(run.info.run_id, [LoggedModelOutput(model.model_id, step=0)])
        found = self._find_version(model, record, run)
        version = found or self._register(model, record, run)
        self._mirrored.append((record, version))
        return model, {
            "models": int(not is_whole),
            "model versions": int(found is None),
            "model notes": self._describe(model, version, record, run),
        }

    def crown(self) -> str | None:
        """Point `champion` at the mirrored version that did best in validation; say so.

        Held-out episodes only judge: a champion chosen by them would look better than it is.
        """
        scores = {
            version.version: score
            for record, version in self._mirrored
            if (score := record.validation_return) is not None
        }
        if not scores:
            return None
        best = max(scores, key=lambda version: scores[version])
        if str(best) == str(self._champion):
            return None
        self._store.client.set_registered_model_alias(self._name, CHAMPION, best)
        return f"{self._name}: {CHAMPION} is version {best}, validation return {scores[best]:.1f}"

    def _describe(
        self, model: LoggedModel, version: ModelVersion, record: SeedRecord, run: Run
    ) -> int:
        """Bring tags and descriptions of a model and its version up to date; count them."""
        client = self._store.client
        own = changed(model.tags, _model_tags(record, run))
        if own:
            client.set_logged_model_tags(model.model_id, own)
        tags = changed(version.tags, _origin_tags(record, run))
        for tag in tags.items():
            client.set_model_version_tag(self._name, version.version, *tag)
        is_described = version.description == _description(record, run)
        if not is_described:
            client.update_model_version(self._name, version.version, _description(record, run))
        return len(own) + len(tags) + (not is_described)

    def _find_model(self, record: SeedRecord) -> LoggedModel | None:
        tags = _policy_tags(record).items()
        return next((model for model in self._models if tags <= model.tags.items()), None)

    def _find_champion(self) -> str | None:
        """Return the champion's version; create and describe the registered model if needed."""
        client = self._store.client
        found = client.search_registered_models(f"name = '{self._name}'")
        if not found:
            client.create_registered_model(self._name, description=ABOUT)
            return None
        if found[0].description != ABOUT:
            client.update_registered_model(self._name, ABOUT)
        champion: str | None = found[0].aliases.get(CHAMPION)
        return champion

    def _find_version(
        self, model: LoggedModel, record: SeedRecord, run: Run
    ) -> ModelVersion | None:
        """Return the policy's version; one whose model or run is gone is deleted."""
        found = None
        for version in self._known:
            if not _policy_tags(record).items() <= version.tags.items():
                continue
            is_own = version.source == f"models:/{model.model_id}"
            if is_own and version.run_id == run.info.run_id and found is None:
                found = version
            else:
                self._store.client.delete_model_version(self._name, version.version)
        return found

    def _register(self, model: LoggedModel, record: SeedRecord, run: Run) -> ModelVersion:
        client = self._store.client
        version = client.create_model_version(
            self._name,
            f"models:/{model.model_id}",
            run.info.run_id,
            tags=_origin_tags(record, run),
            description=_description(record, run),
            model_id=model.model_id,
        )
        client.set_logged_model_tags(
            model.model_id, internals.registered_tag(self._name, version.version)
        )
        return version


def _is_whole(store: Store, model: LoggedModel, record: SeedRecord) -> bool:
    """Tell whether a model has all its files: by content on this machine, else by size."""
    if str(model.status) != "READY":
        return False
    if folder := internals.local_folder(model.artifact_location):
        return model.tags.get(FILES_DIGEST) == folder_digest(folder)
    listed = store.client.list_logged_model_artifacts(model.model_id)
    if "MLmodel" not in {entry.path for entry in listed}:
        return False
    stored = store.client.list_logged_model_artifacts(model.model_id, "artifacts")
    return [entry.file_size for entry in stored] == [record.policy_path.stat().st_size]


def _log(store: Store, record: SeedRecord, run: Run, model: LoggedModel | None) -> LoggedModel:
    """Upload a model; the files of an existing one are replaced."""
    if model is None:
        model = store.client.create_logged_model(
            store.experiment_id,
            record.name,
            run.info.run_id,
            _model_tags(record, run),
            record.params,
        )
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
                run_id=run.info.run_id,
                model_uuid=model.model_id,
                model_id=model.model_id,
            ),
        )
        if own_folder := internals.local_folder(model.artifact_location):
            shutil.rmtree(own_folder, ignore_errors=True)
        store.client.log_model_artifacts(model.model_id, str(path))
        digest = {FILES_DIGEST: folder_digest(path)}
        store.client.set_logged_model_tags(model.model_id, digest)
        model.tags.update(digest)
    return store.client.finalize_logged_model(model.model_id, "READY")


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
    return {AGENT: record.agent, SEED: str(record.seed), POLICY_DIGEST: record.digest}


def _origin_tags(record: SeedRecord, run: Run) -> dict[str, str]:
    """Return the tags that lead back to the code, the pipeline and the file."""
    tags = {ALGORITHM: record.algorithm, DVC_STAGE: record.stage, DVC_MD5: record.md5}
    tags[HOLD] = str(record.hold)
    commit = run.data.tags.get(GIT_COMMIT)
    return _policy_tags(record) | tags | ({GIT_COMMIT: commit} if commit else {})


def _model_tags(record: SeedRecord, run: Run) -> dict[str, str]:
    source = source_tags(record.stage, run.data.tags.get(GIT_COMMIT))
    return _origin_tags(record, run) | source | {pages.NOTE: _description(record, run)}


def _description(record: SeedRecord, run: Run) -> str:
    return record.describe(run.data.tags.get(GIT_COMMIT))
