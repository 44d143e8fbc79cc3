"""Trainings in this process compute as those of workers do."""

from jumping_ant.agents.kernels import use_portable_kernels

use_portable_kernels()
