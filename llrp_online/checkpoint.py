"""Checkpoints: a directory of safetensors files and a manifest, whole or not there.

A new checkpoint is written beside the old one and renamed into its place. A crash at any moment leaves the old or the
new, and `load` finds it. The manifest holds a checksum of each file. Nothing is ever unpickled. What is too large to be
there twice, as the frames of a full memory, is written and read a part at a time, each part a file.
"""

import base64
import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

if TYPE_CHECKING:
    import torch

Arrays = Mapping[str, NDArray[Any]]

FORMAT = 1
MANIFEST = "manifest.json"


class CheckpointError(ValueError):
    """A checkpoint that cannot be written or read; the message names the file and what is wrong with it."""


def save(
    path: str | Path,
    tensors: Mapping[str, Arrays],
    manifest: Mapping[str, Any],
    parts: Mapping[str, Iterable[Arrays]] | None = None,
) -> None:
    """Write a checkpoint, replacing one that is there.

    Args:
        path: the directory. One that exists must be a checkpoint or empty; anything else is left alone.
        tensors: file stem -> name -> array; `weights` must be among the stems.
        manifest: JSON values to keep with them; `format` and `sha256` are added.
        parts: file stem -> name -> array, again and again: each part is asked for when the one before is written.
    """
    path = Path(path).resolve()  # a symbolic link stays one; what it points to is replaced
    series = parts or {}
    _check(path, tensors, series, manifest)
    staged, retired = _staged(path), _retired(path)
    if staged.exists():
        shutil.rmtree(staged)
    staged.mkdir(parents=True)
    digests = {name: _write_tensors(staged / name, arrays) for name, arrays in _files(tensors, series)}
    text = json.dumps({"format": FORMAT, "sha256": digests, **manifest}, indent=1, allow_nan=False)
    _write(staged / MANIFEST, text.encode())
    _sync(staged)
    if path.exists():
        # With `path` whole, a retired one is left over from a crash and of no more use.
        if retired.exists():
            shutil.rmtree(retired)
        path.rename(retired)
    staged.rename(path)
    _sync(path.parent)
    if retired.exists():
        shutil.rmtree(retired)


def must_be_free(path: str | Path) -> None:
    """CheckpointError where `save` would refuse to write: ask before the work, not after it."""
    path = Path(path).resolve()
    if path.exists() and not (path / MANIFEST).is_file() and (not path.is_dir() or any(path.iterdir())):
        raise CheckpointError(f"{path}: exists and is no checkpoint (no {MANIFEST}); not replaced: give another path")


def load(path: str | Path) -> tuple[dict[str, dict[str, NDArray[Any]]], dict[str, Any]]:
    """What `save` was given: tensors and manifest. CheckpointError if it is missing, damaged or of another format."""
    directory, manifest = _found(path)
    tensors: dict[str, dict[str, NDArray[Any]]] = {}
    for name, digest in manifest.pop("sha256").items():
        if _series(name) is None:
            tensors[Path(name).stem] = _read_tensors(directory / name, digest)
        else:
            _must_match(directory / name, digest)
    del manifest["format"]
    return tensors, manifest


def load_parts(path: str | Path, stem: str) -> Iterator[dict[str, NDArray[Any]]]:
    """The parts that `save` was given under a stem, in order, each read when asked for; none where there were none."""
    directory, manifest = _found(path)
    for name, digest in manifest["sha256"].items():
        if _series(name) == stem:
            yield _read_tensors(directory / name, digest)


def must_fit(path: str | Path, manifest: Mapping[str, Any], configuration: Mapping[str, Any]) -> None:
    """CheckpointError where the rows and columns of its labels stand for something else than the configuration's.

    Args:
        path: of the checkpoint, for the message.
        manifest: as `load` gave it.
        configuration: the robot's, in its JSON form.
    """
    mine, others = _labelled(configuration), _labelled(manifest.get("configuration"))
    if mine != others:
        raise CheckpointError(
            f"{path}: its labels are of other targets or sensors than the configuration's (expected {mine}, got "
            f"{others}); give the configuration it was trained with"
        )


def _labelled(configuration: Any) -> tuple[Any, list[str]] | None:
    """What the rows and columns of a configuration's labels stand for; None if it is no configuration."""
    try:
        return configuration["targets"], [sensor["name"] for sensor in configuration["short_range"]]
    except (KeyError, TypeError):
        return None


def numpy_state(generator: np.random.Generator) -> dict[str, Any]:
    """A generator's state as JSON values; for `np.random.default_rng` (PCG64).

    >>> generator = np.random.default_rng(3)
    >>> twin = numpy_generator(json.loads(json.dumps(numpy_state(generator))))
    >>> float(generator.random()) == float(twin.random())
    True
    """
    state = dict(generator.bit_generator.state)
    if state["bit_generator"] != "PCG64":
        raise ValueError(f"generator: expected PCG64, as default_rng makes it, got {state['bit_generator']}")
    return state


def numpy_generator(state: Mapping[str, Any]) -> np.random.Generator:
    """The generator that `numpy_state` was taken of."""
    generator = np.random.Generator(np.random.PCG64())
    generator.bit_generator.state = dict(state)
    return generator


def torch_state(generator: "torch.Generator") -> str:
    """A generator's state as text."""
    return base64.b64encode(generator.get_state().numpy().tobytes()).decode()


def set_torch_state(generator: "torch.Generator", state: str) -> None:
    """Put a generator into the state that `torch_state` gave."""
    # Imported here so that a process which only infers can read checkpoints without PyTorch.
    import torch

    generator.set_state(torch.tensor(list(base64.b64decode(state)), dtype=torch.uint8))


def _files(tensors: Mapping[str, Arrays], parts: Mapping[str, Iterable[Arrays]]) -> Iterator[tuple[str, Arrays]]:
    """What is in each file, by its name."""
    for stem, arrays in tensors.items():
        yield f"{stem}.safetensors", arrays
    for stem, series in parts.items():
        for number, arrays in enumerate(series):
            yield f"{stem}.{number}.safetensors", arrays


def _series(name: str) -> str | None:
    """Of a file that holds one part of a series, the stem; None of any other."""
    stem, _, number = name.removesuffix(".safetensors").partition(".")
    return stem if number else None


def _found(path: str | Path) -> tuple[Path, dict[str, Any]]:
    """The directory that holds the checkpoint, and its manifest."""
    path = Path(path).resolve()
    directory = path
    if not path.exists() and _retired(path).exists():
        directory = _retired(path)  # a crash came between the two renames
    if not (directory / MANIFEST).is_file():
        raise CheckpointError(f"{path}: no checkpoint; expected a directory with {MANIFEST}")
    return directory, _read_manifest(directory / MANIFEST)


def _check(
    path: Path, tensors: Mapping[str, Arrays], parts: Mapping[str, Iterable[Arrays]], manifest: Mapping[str, Any]
) -> None:
    if "weights" not in tensors:
        raise CheckpointError(f"{path}: expected `weights` among the tensors, got {sorted(tensors)}")
    if wrong := [stem for stem in (*tensors, *parts) if not re.fullmatch(r"[a-z][a-z0-9_]*", stem)]:
        raise CheckpointError(f"{path}: file stems must be lower-case words, got {wrong}")
    if taken := {"format", "sha256"} & set(manifest):
        raise CheckpointError(f"{path}: the manifest's keys {sorted(taken)} are the checkpoint's own; rename them")
    try:
        json.dumps(dict(manifest), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise CheckpointError(f"{path}: the manifest cannot be written as JSON: {error}") from error
    must_be_free(path)


def _read_manifest(file: Path) -> dict[str, Any]:
    try:
        manifest = json.loads(file.read_bytes())
        version, digests = manifest["format"], manifest["sha256"]
    except (ValueError, TypeError, KeyError) as error:
        raise CheckpointError(f"{file}: damaged: expected JSON with `format` and `sha256` ({error!r})") from error
    if version != FORMAT:
        raise CheckpointError(f"{file}: format {version!r}; this program reads format {FORMAT}")
    if not isinstance(digests, dict) or "weights.safetensors" not in digests:
        raise CheckpointError(f"{file}: damaged: expected `weights.safetensors` under `sha256`, got {digests!r}")
    return manifest


def _read_tensors(file: Path, digest: str) -> dict[str, NDArray[Any]]:
    _must_match(file, digest)
    try:
        return safetensors.numpy.load_file(file)
    except safetensors.SafetensorError as error:
        raise CheckpointError(f"{file}: not valid safetensors: {error}") from error


def _must_match(file: Path, digest: str) -> None:
    try:
        found = _digest(file)
    except OSError as error:
        raise CheckpointError(f"{file}: cannot be read: {error.strerror}") from error
    if found != digest:
        raise CheckpointError(f"{file}: damaged: expected SHA-256 {digest}, got {found}")


def _staged(path: Path) -> Path:
    return path.with_name(f".{path.name}.new")


def _retired(path: Path) -> Path:
    return path.with_name(f".{path.name}.old")


def _write_tensors(file: Path, arrays: Arrays) -> str:
    """Write a file straight from the arrays, which may be most of the memory there is; return its SHA-256."""
    # safetensors writes memory as it lies, so it must lie in C order.
    safetensors.numpy.save_file({name: np.asarray(array, order="C") for name, array in arrays.items()}, file)
    with file.open("rb") as stream:
        os.fsync(stream.fileno())
    return _digest(file)


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _write(file: Path, content: bytes) -> None:
    with file.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def _sync(directory: Path) -> None:
    """Make the names in a directory outlive a power cut."""
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
