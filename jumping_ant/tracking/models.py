"""Policies as MLflow models: logged, registered, the best in validation named champion."""

import json
import tempfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import mlflow.pyfunc
import numpy as np
from mlflow.entities import LoggedModel, LoggedModelOutput, Run
from mlflow.models import Model, ModelSignature
from mlflow.types import Schema, TensorSpec
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS

from jumping_ant.base.files import CODE_ROOT
from jumping_ant.policies import policy_file
from jumping_ant.tracking import pages
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.records import SeedRecord, stage
from jumping_ant.tracking.store import Store

CHAMPION = "champion"
ABOUT = (
    "A jumping robot: observations in, torques over peak torque out, a row each. Hold each "
    "output for as many control steps as the version's tag `hold` says, then ask for the next one. "
    "`champion` is the seed whose policy did best in validation, not on the held-out episodes."
)
PACKAGE_DIR = CODE_ROOT / "jumping_ant"
CODE = PACKAGE_DIR / "tracking" / "serving.py"
REQUIREMENTS = ("mlflow", "numpy", "pydantic")  # of the code and all that it imports


def registered_name(agent: str) -> str:
    """Return the name of an agent's registered model."""
    return f"jumping-ant-{agent}"


def create(store: Store, agent: str) -> None:
    """Register an agent's model, unless it is registered."""
    if not store.client.search_registered_models(f"name = '{registered_name(agent)}'"):
        store.client.create_registered_model(registered_name(agent), description=ABOUT)


def has(store: Store, run: Run) -> bool:
    """Tell whether a run has a model that is registered, and whose files are there."""
    versions = store.client.search_model_versions(f"run_id = '{run.info.run_id}'")
    registered = {str(version.source).removeprefix("models:/") for version in versions}
    for model in store.logged_models(f"source_run_id = '{run.info.run_id}'"):
        if model.model_id in registered and str(model.status) == "READY":
            listed = store.client.list_logged_model_artifacts(model.model_id)
            return "MLmodel" in {entry.path for entry in listed}
    return False


def log(store: Store, record: SeedRecord, run: Run) -> str:
    """Log and register the model of a new run, and return its id."""
    note = record.describe()
    tags = {  # which lead back to the code, the pipeline and the file
        stores.AGENT: record.agent,
        stores.SEED: str(record.seed),
        stores.POLICY_DIGEST: record.digest,
        stores.ALGORITHM: record.algorithm,
        stores.DVC_STAGE: stage(record.agent),
        stores.DVC_MD5: record.md5,
        stores.HOLD: str(record.hold),
    }
    source = stores.source_tags(stage(record.agent))
    model = store.client.create_logged_model(
        *(store.experiment_id, record.name, run.info.run_id),
        tags | source | {pages.NOTE: note},
        record.params,
    )
    _upload(store, record, model)
    # The run shows its outputs.
    store.client.log_outputs(run.info.run_id, [LoggedModelOutput(model.model_id, step=0)])
    name = registered_name(record.agent)
    registered = store.client.create_model_version(
        *(name, f"models:/{model.model_id}", run.info.run_id),
        tags=tags,
        description=note,
        model_id=model.model_id,
    )
    # By this tag the model's page leads to the version that it is registered as.
    link = json.dumps([{"name": name, "version": registered.version}])
    store.client.set_logged_model_tags(model.model_id, {MLFLOW_MODEL_VERSIONS: link})
    return str(model.model_id)


def name_commit(store: Store, run: Run, commit: str) -> None:
    """Have the model of a run, and its version, name a commit."""
    for version in store.client.search_model_versions(f"run_id = '{run.info.run_id}'"):
        store.client.set_model_version_tag(version.name, version.version, stores.GIT_COMMIT, commit)
    for model in store.logged_models(f"source_run_id = '{run.info.run_id}'"):
        store.client.set_logged_model_tags(model.model_id, {stores.GIT_COMMIT: commit})


def clear(store: Store, record: SeedRecord, run: Run) -> None:
    """Delete a policy's models whose runs are deleted; a user's aliases move to this run's."""
    kept = {it.info.run_id for it in store.seed_runs(record.agent, record.seed)}
    name, policy = registered_name(record.agent), f"tags.{stores.POLICY_DIGEST} = '{record.digest}'"
    versions = store.client.search_model_versions(f"name = '{name}' and {policy}")
    current = next(it.version for it in versions if it.run_id == run.info.run_id)
    for version in versions:
        if version.run_id not in kept:
            for alias, number in store.client.get_registered_model(name).aliases.items():
                if str(number) == str(version.version):
                    store.client.set_registered_model_alias(name, alias, current)
            store.client.delete_model_version(name, version.version)
    for model in store.logged_models(policy):
        if model.source_run_id not in kept:
            store.client.delete_logged_model(model.model_id)


def crown(store: Store, agent: str, scores: Mapping[str, float]) -> str | None:
    """Point `champion` at the version that did best in validation; say so if it changed.

    `scores` are returns in validation by run. Held-out episodes only judge: a champion chosen by
    them would look better than it is.
    """
    if not scores:
        return None
    name, best = registered_name(agent), max(scores, key=lambda run_id: scores[run_id])
    champion, *_ = store.client.search_model_versions(f"name = '{name}' and run_id = '{best}'")
    aliases = store.client.get_registered_model(name).aliases
    if str(aliases.get(CHAMPION)) == str(champion.version):
        return None
    store.client.set_registered_model_alias(name, CHAMPION, champion.version)
    return f"{name}: {CHAMPION} is version {champion.version}, validation return {scores[best]:.1f}"


def _upload(store: Store, record: SeedRecord, model: LoggedModel) -> None:
    interface = policy_file.read_interface(record.policy_path)
    width = interface.num_observations or -1  # any, if observations are not used
    signature = ModelSignature(
        inputs=Schema([TensorSpec(np.dtype(np.float64), (-1, width))]),
        outputs=Schema([TensorSpec(np.dtype(np.float64), (-1, interface.num_motors))]),
    )
    with tempfile.TemporaryDirectory() as folder:
        path, policy = Path(folder) / "model", Path(folder) / record.policy_path.name
        policy.write_bytes(record.content)  # MLflow refuses links, as DVC's cache may make
        mlflow.pyfunc.save_model(
            path,
            python_model=str(CODE),
            artifacts={"policy": str(policy)},
            code_paths=[str(PACKAGE_DIR)],
            signature=signature,
            input_example=np.zeros((1, abs(width))),
            pip_requirements=[f"{name}=={metadata.version(name)}" for name in REQUIREMENTS],
            mlflow_model=Model(
                artifact_path=model.artifact_location,
                run_id=model.source_run_id,
                model_uuid=model.model_id,
                model_id=model.model_id,
            ),
        )
        store.client.log_model_artifacts(model.model_id, str(path))
    store.client.finalize_logged_model(model.model_id, "READY")
