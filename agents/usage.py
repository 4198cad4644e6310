"""The error of a command line whose words do not go together."""


class UsageError(ValueError):
    """Words that a parser lets pass one by one and that make no sense together; the message says what would."""
