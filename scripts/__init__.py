import jumping_ant  # noqa: F401  (selects the kernels of numerical libraries, before their import)
