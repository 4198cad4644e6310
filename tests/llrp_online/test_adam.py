import subprocess
import sys

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from llrp_online.adam import MOMENTS, Adam

SHAPES = st.lists(st.lists(st.integers(1, 9), min_size=1, max_size=4), min_size=1, max_size=4)


def parameters(shapes, seed):
    """Convolutions lie in memory as the network's do, channels last."""
    rng = np.random.default_rng(seed)
    drawn = [torch.from_numpy(rng.standard_normal(shape, np.float32)) for shape in shapes]
    return [(p.contiguous(memory_format=torch.channels_last) if p.ndim == 4 else p).requires_grad_() for p in drawn]


@settings(max_examples=50, deadline=None)
@given(SHAPES, st.floats(1e-5, 1.0), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_steps_are_those_of_pytorch_to_the_bit(shapes, learning_rate, steps, seed):
    ours, theirs = parameters(shapes, seed), parameters(shapes, seed)
    adam, peer = Adam(ours, learning_rate), torch.optim.Adam(theirs, learning_rate, fused=True)
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        for a, b in zip(ours, theirs, strict=True):
            gradient = torch.from_numpy(rng.standard_normal(a.shape, np.float32) * np.float32(10 ** rng.normal()))
            a.grad, b.grad = gradient.clone(), gradient.clone()
        adam.step()
        peer.step()
    for a, b, moments in zip(ours, theirs, adam.moments, strict=True):
        assert torch.equal(a, b)
        assert set(moments) == set(peer.state[b]) == set(MOMENTS)
        assert all(torch.equal(moments[name], peer.state[b][name]) for name in MOMENTS)


def test_a_training_step_does_not_load_the_compiler():
    code = """
import sys
import numpy as np
from llrp_online.trainer import Trainer
from replay.compiling import use
from tests.llrp_online.test_trainer import EVEN, batch, configuration
use(compiled=False)
Trainer(configuration()).step(batch(), EVEN)
print([name for name in sys.modules if name.startswith(("torch._dynamo", "torch._inductor"))][:3])
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout.strip() == "[]"
