"""How to install what comes with an extra."""


def install(extra: str) -> str:
    """What to type, in the project's folder, where its versions are kept.

    >>> install("ros")
    "pip install --constraint constraints.txt --editable '.[ros]' in the project's folder"
    """
    return f"pip install --constraint constraints.txt --editable '.[{extra}]' in the project's folder"
