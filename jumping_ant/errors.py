"""The one exception for mistakes of the person who runs the pipeline."""


class InputError(ValueError):
    """Bad input: the message says what was given, what is allowed and where.

    Stages print the message without a traceback and exit with status 2.
    """
