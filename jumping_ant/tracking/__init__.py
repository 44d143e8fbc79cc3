"""The switch of MLflow's telemetry: any module here is imported after it."""

from jumping_ant.base import telemetry

telemetry.switch_off()
