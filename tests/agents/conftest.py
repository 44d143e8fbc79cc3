"""Trainings in this process compute as those of workers do."""

from jumping_ant.agents import kernels

kernels.use()
