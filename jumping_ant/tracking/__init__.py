"""The switch of MLflow's telemetry: any module here is imported after it."""

from jumping_ant.base import command_line

command_line.switch_off_telemetry()
