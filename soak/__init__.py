"""The project under ill treatment, for as long as one likes; the tests keep a short version."""

import stages  # noqa: F401  (nothing phones home: before any import)
