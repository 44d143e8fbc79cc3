"""Trainings in this process compute as those of workers do."""

from jumping_ant.agents import kernels
from jumping_ant.base import machine

kernels.use(machine.BLAS_THREADS)
