"""SE(2) and targets: the algebra that everything else rests on."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.poses import compose, interpolate, relative, wrap
from replay.targets import Targets

poses = st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(-3.1, 3.1)).map(np.array)


@given(poses, poses)
def test_relative_undoes_compose(origin, step):
    there = compose(origin, step)
    back = relative(origin, there)
    np.testing.assert_allclose(back[:2], step[:2], atol=1e-9)
    assert abs(wrap(back[2] - step[2])) < 1e-9


@given(poses, poses, poses)
def test_compose_is_associative(a, b, c):
    left, right = compose(compose(a, b), c), compose(a, compose(b, c))
    np.testing.assert_allclose(left[:2], right[:2], atol=1e-9)
    assert abs(wrap(left[2] - right[2])) < 1e-9


@given(poses, poses, st.floats(0, 1))
def test_interpolation_takes_the_shorter_arc(start, stop, fraction):
    between = interpolate(start, stop, fraction)
    np.testing.assert_allclose(between[:2], start[:2] + fraction * (stop[:2] - start[:2]), atol=1e-12)
    assert abs(wrap(between[2] - start[2])) <= np.pi * fraction + 1e-9


def test_grid_has_x_outer_and_y_inner():
    grid = Targets.grid([0.0, 1.0, 1.0], [-0.5, 0.5, 0.5])
    np.testing.assert_array_equal(grid.poses[:4, :2], [[0, -0.5], [0, 0], [0, 0.5], [1, -0.5]])


@pytest.mark.parametrize("steps", [(0.0, 0.3, 0.01, 31), (0.0, 2.0, 0.2, 11), (-1.0, 1.0, 0.1, 21)])
def test_line_includes_both_ends(steps):
    start, stop, step, count = steps
    x = Targets.line(start, stop, step).poses[:, 0]
    assert len(x) == count
    assert x[-1] == pytest.approx(stop)


def test_mirror_is_its_own_inverse_and_swaps_headings():
    targets = Targets.listed([[0.1, 0.2, 0.3], [0.5, 0.0, 0.0], [0.1, -0.2, -0.3], [0.0, 0.0, np.pi]])
    mirror = targets.mirror()
    assert mirror.tolist() == [2, 1, 0, 3]


def test_bad_targets_say_what_was_got():
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        Targets.listed([0.0, 1.0])
    with pytest.raises(ValueError, match=r"start=1.0, stop=0.0, step=0.1"):
        Targets.line(1.0, 0.0, 0.1)
