import hashlib
import json
import pathlib
import shutil

import numpy as np
import pytest
import torch

from llrp_online import checkpoint
from llrp_online.checkpoint import CheckpointError, load, load_parts, save


def content(value):
    weights = {"dense.weight": np.full((3, 2), value, np.float32), "step": np.array(value)}
    memory = {"pictures": np.full((2, 4, 5, 3), value, np.uint8), "labels": np.full((2, 7), -1, np.int8)}
    return {"weights": weights, "memory": memory}, {"configuration": {"robot": "thymio"}, "value": value}


def parts(value):
    return {"frames": ({"pictures": np.full((2, 4), value, np.uint8)} for _ in range(2))}


def value_in(path):
    tensors, manifest = load(path)
    assert {int(part["pictures"][0, 0]) for part in load_parts(path, "frames")} <= {manifest["value"]}
    assert set(tensors) == {"weights", "memory"}
    assert tensors["weights"]["dense.weight"][0, 0] == tensors["memory"]["pictures"][0, 0, 0, 0] == manifest["value"]
    return manifest["value"]


def test_what_is_saved_is_loaded(tmp_path):
    tensors, manifest = content(7)
    tensors["memory"]["strided"] = np.arange(24).reshape(4, 6).T[::2]
    tensors["memory"]["bits"] = np.array([True, False])
    save(tmp_path / "run" / "checkpoint", tensors, manifest)
    found, found_manifest = load(tmp_path / "run" / "checkpoint")
    assert found_manifest == manifest
    for stem, arrays in tensors.items():
        assert set(found[stem]) == set(arrays)
        for name, array in arrays.items():
            assert found[stem][name].dtype == array.dtype
            assert found[stem][name].flags.writeable
            np.testing.assert_array_equal(found[stem][name], array)
    files = {file.name for file in (tmp_path / "run" / "checkpoint").iterdir()}
    assert files == {"weights.safetensors", "memory.safetensors", "manifest.json"}


def test_a_new_one_replaces_the_old_and_leaves_nothing_else(tmp_path):
    for value in (1, 2, 3):
        save(tmp_path / "c", *content(value))
        assert value_in(tmp_path / "c") == value
    assert [entry.name for entry in tmp_path.iterdir()] == ["c"]


class Crash(BaseException):
    """Stands for the process ending here: nothing may catch it to tidy up."""


def crash_after(monkeypatch, steps):
    """Let the first `steps` changes to the disk happen; end the process at the next. A write loses half of itself."""
    left = [steps]

    def guarded(action, before_crash=lambda *_: None):
        def act(*args, **kwargs):
            if left[0] == 0:
                before_crash(*args)
                raise Crash
            left[0] -= 1
            return action(*args, **kwargs)

        return act

    def half_a_write(file, _):
        file.write_bytes(b'{"half')

    def half_a_removal(directory):
        next(iter(directory.iterdir())).unlink()

    monkeypatch.setattr(checkpoint, "_write", guarded(checkpoint._write, half_a_write))
    monkeypatch.setattr(checkpoint, "_write_tensors", guarded(checkpoint._write_tensors, half_a_write))
    monkeypatch.setattr(checkpoint.shutil, "rmtree", guarded(shutil.rmtree, half_a_removal))
    monkeypatch.setattr(pathlib.Path, "rename", guarded(pathlib.Path.rename))
    monkeypatch.setattr(pathlib.Path, "mkdir", guarded(pathlib.Path.mkdir))


def test_a_crash_at_any_moment_leaves_the_old_or_the_new(tmp_path):
    seen = []
    for first in range(12):
        for second in range(12):
            path = tmp_path / f"{first}-{second}" / "c"
            save(path, *content(1), parts(1))
            value = 1
            # Two crashes in a row, so that a half-made directory is met too.
            for number, steps in ((2, first), (3, second)):
                with pytest.MonkeyPatch.context() as monkeypatch:
                    crash_after(monkeypatch, steps)
                    try:
                        save(path, *content(number), parts(number))
                        finished = True
                    except Crash:
                        finished = False
                found = value_in(path)
                assert len(list(load_parts(path, "frames"))) == 2
                assert found == number if finished else found in (value, number)
                value = found
                seen.append((finished, found))
            save(path, *content(4))
            assert value_in(path) == 4
            assert [entry.name for entry in path.parent.iterdir()] == ["c"]
    assert {(False, 1), (False, 2), (False, 3), (True, 2), (True, 3)} <= set(seen)


def test_parts_are_written_and_read_one_at_a_time(tmp_path):
    path, staged = tmp_path / "c", tmp_path / ".c.new"

    def frames():
        for number in range(12):
            written = [f"frames.{before}.safetensors" for before in range(number)]
            assert sorted(file.name for file in staged.glob("frames.*")) == sorted(written)
            yield {"pictures": np.full((3, 4), number, np.uint8)}

    tensors, manifest = content(1)
    save(path, tensors, manifest, {"frames": frames()})
    assert set(load(path)[0]) == {"weights", "memory"}
    assert [part["pictures"].max() for part in load_parts(path, "frames")] == list(range(12))
    assert list(load_parts(path, "others")) == []
    damage(path, "frames.11.safetensors", lambda data: data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(CheckpointError, match=r"frames\.11\.safetensors: damaged: expected SHA-256"):
        load(path)
    with pytest.raises(CheckpointError, match="lower-case words"):
        save(path, tensors, manifest, {"frames.1": frames()})


def test_a_first_save_that_crashes_leaves_no_checkpoint(tmp_path):
    with pytest.MonkeyPatch.context() as monkeypatch:
        crash_after(monkeypatch, 3)
        with pytest.raises(Crash):
            save(tmp_path / "c", *content(1))
    with pytest.raises(CheckpointError, match="no checkpoint"):
        load(tmp_path / "c")


def test_a_symbolic_link_stays_one(tmp_path):
    save(tmp_path / "real", *content(1))
    (tmp_path / "link").symlink_to("real")
    save(tmp_path / "link", *content(2))
    assert (tmp_path / "link").is_symlink()
    assert value_in(tmp_path / "real") == value_in(tmp_path / "link") == 2


def test_a_directory_of_something_else_is_never_replaced(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(CheckpointError, match=r"is no checkpoint .* not replaced"):
        save(tmp_path, *content(1))
    assert (tmp_path / "notes.txt").read_text() == "mine"
    (tmp_path / "empty").mkdir()
    save(tmp_path / "empty", *content(1))
    assert value_in(tmp_path / "empty") == 1


def damage(path, name, change):
    file = path / name
    file.write_bytes(change(file.read_bytes()))


def rewrite_manifest(path, **changes):
    manifest = json.loads((path / "manifest.json").read_text())
    (path / "manifest.json").write_text(json.dumps({**manifest, **changes}))


def test_damage_is_named(tmp_path):
    path = tmp_path / "c"

    save(path, *content(1))
    damage(path, "memory.safetensors", lambda data: data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(CheckpointError, match=r"memory\.safetensors: damaged: expected SHA-256"):
        load(path)

    save(path, *content(1))
    (path / "memory.safetensors").unlink()
    with pytest.raises(CheckpointError, match=r"memory\.safetensors: cannot be read: No such file"):
        load(path)

    save(path, *content(1))
    rewrite_manifest(path, format=99)
    with pytest.raises(CheckpointError, match=r"manifest\.json: format 99; this program reads format 1"):
        load(path)

    save(path, *content(1))
    damage(path, "manifest.json", lambda data: data[:40])
    with pytest.raises(CheckpointError, match=r"manifest\.json: damaged"):
        load(path)

    save(path, *content(1))
    rewrite_manifest(path, sha256={})
    with pytest.raises(CheckpointError, match=r"expected `weights\.safetensors`"):
        load(path)

    save(path, *content(1))
    rewrite_manifest(path, sha256={"weights.safetensors": hashlib.sha256(b"garbage").hexdigest()})
    damage(path, "weights.safetensors", lambda _: b"garbage")
    with pytest.raises(CheckpointError, match=r"weights\.safetensors: not valid safetensors"):
        load(path)


def test_what_cannot_be_saved_is_named_before_anything_is_touched(tmp_path):
    path = tmp_path / "c"
    save(path, *content(1))
    tensors, manifest = content(2)
    with pytest.raises(CheckpointError, match="expected `weights` among the tensors"):
        save(path, {"memory": tensors["memory"]}, manifest)
    with pytest.raises(CheckpointError, match="lower-case words"):
        save(path, {**tensors, "../up": {}}, manifest)
    with pytest.raises(CheckpointError, match="'format'"):
        save(path, tensors, {"format": 3})
    for value in (float("nan"), np.zeros(3)):
        with pytest.raises(CheckpointError, match="the manifest cannot be written as JSON"):
            save(path, tensors, {"loss": value})
    assert value_in(path) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["c"]


def test_random_states_go_through_json():
    numpy_generator, torch_generator = np.random.default_rng(5), torch.Generator().manual_seed(5)
    numpy_generator.random(3), torch.rand(3, generator=torch_generator)
    state = json.loads(json.dumps([checkpoint.numpy_state(numpy_generator), checkpoint.torch_state(torch_generator)]))
    expected = numpy_generator.random(4), torch.rand(4, generator=torch_generator)
    other = torch.Generator()
    checkpoint.set_torch_state(other, state[1])
    assert np.array_equal(checkpoint.numpy_generator(state[0]).random(4), expected[0])
    assert torch.equal(torch.rand(4, generator=other), expected[1])
    with pytest.raises(ValueError, match="expected PCG64, as default_rng makes it, got Philox"):
        checkpoint.numpy_state(np.random.Generator(np.random.Philox(0)))
