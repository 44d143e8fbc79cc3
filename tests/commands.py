"""The article's five commands, as tests take them: torques over peak torque at amplitude 1."""

import numpy as np
from numpy.typing import NDArray

from jumping_ant.params import article

COMMAND_SIGNS: NDArray[np.float32] = np.array(article.ENV.commands, dtype=np.float32)
