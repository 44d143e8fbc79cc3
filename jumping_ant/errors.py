"""The exceptions that end a stage in one clear line."""


class InputError(ValueError):
    """Bad input: the message says what was given, what is allowed and where.

    Stages print the message without a traceback and exit with status 2.
    """


class WorkerError(Exception):
    """A process that the work needs dies again and again, or does not start; the message says so.

    Stages print the message without a traceback and exit with status 1.
    """


class StoppedError(Exception):
    """Someone asked for an end: the message says what is kept and how it goes on.

    Stages print the message without a traceback and exit with status 130, as shells have it.
    """
