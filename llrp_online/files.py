"""Files that are written whole or not at all."""

import os
from pathlib import Path


def replace(file: Path, content: str | bytes) -> None:
    """Write beside and rename: a reader meets the old file or the new one, never a part.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     replace(Path(folder) / "a.txt", "all of it")
    ...     (Path(folder) / "a.txt").read_text()
    'all of it'
    """
    beside = file.with_name(f".{file.name}.new")
    with beside.open("wb") as stream:
        stream.write(content.encode() if isinstance(content, str) else content)
        stream.flush()
        os.fsync(stream.fileno())
    beside.replace(file)
