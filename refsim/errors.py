"""The one error that bad input raises: a sentence naming the culprit.

The command line prints it on stderr and exits with 2; in a script it is a ``ValueError``.
"""


class InputError(ValueError):
    """What a user asked for cannot be done; the message is one sentence that names the culprit and the mend."""
