"""A policy as an MLflow model.

MLflow stores this file, the package and the policy file, and runs this file to load the model
("models from code"): nothing is pickled. The input is a batch of observations, shape (n,
num_observations), the output the torques over peak torque, shape (n, num_motors) (see
`jumping_ant.sim.task`).
"""

from pathlib import Path
from typing import Any

import mlflow
import numpy as np
from mlflow.pyfunc import PythonModel, PythonModelContext
from numpy.typing import NDArray

from jumping_ant.policies import policy_file


class ServedPolicy(PythonModel):
    """Feeds observations to the policy file stored with the model.

    Row `i` of every batch belongs to episode `i`; a batch of another size starts new episodes,
    which matters only to a policy that samples its torques.
    """

    def load_context(self, context: PythonModelContext) -> None:
        """Read the policy file."""
        self._policy = policy_file.load(Path(context.artifacts["policy"]))
        self._num_episodes = 0

    def predict(
        self,
        context: PythonModelContext,
        model_input: np.ndarray,  # the only array type hint that MLflow supports
        params: dict[str, Any] | None = None,
    ) -> NDArray[np.float64]:
        """Return torques (n, num_motors) for observations (n, num_observations)."""
        if len(model_input) != self._num_episodes:
            self._num_episodes = len(model_input)
            self._policy.start(range(self._num_episodes))
        return self._policy.act(model_input)


mlflow.models.set_model(ServedPolicy())
