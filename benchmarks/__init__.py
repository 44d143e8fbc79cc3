"""The project compared with what one would otherwise run: `make bench`."""

import stages  # noqa: F401  (disables telemetry, before any import)
