"""Fault injection into the project, for any duration; the tests run a short version."""

import stages  # noqa: F401  (disables telemetry, before any import)
