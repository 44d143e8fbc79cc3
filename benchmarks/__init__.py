"""The project side by side with what one would otherwise run: `make bench`."""

import stages  # noqa: F401  (nothing phones home: before any import)
