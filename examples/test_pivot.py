"""Pivot and assert: a test suite of your own that fails when the contact slips, opens, or loses its reference.

Run it with `pytest examples/test_pivot.py`.
"""

import pytest
from pivoting import Run, assert_sticking, assert_tracking, simulate


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate("pivot-2d", worlds=8, seed=1, seconds=0.8)


def test_the_corner_sticks(run: Run) -> None:
    assert_sticking(run, slip_m=5e-5)


def test_the_block_follows_the_arc(run: Run) -> None:
    assert_tracking(run, rms_deg=0.02, max_deg=0.05)


def test_less_friction_than_believed_is_noticed() -> None:
    """A check that the checks work: on a slippery table the corner must not be said to stick."""
    slippery = simulate("pivot-2d", seconds=0.8, world={"mu": 0.1})
    with pytest.raises(AssertionError, match="slip_max_m"):
        assert_sticking(slippery)
