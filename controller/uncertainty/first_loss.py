"""Where on a line a slack is lost for the first time: by samples, their dips, and a bracketed search for the root."""

from collections.abc import Callable

import numpy as np

SAMPLES, IN_A_DIP, DIPS = 24, 8, 4  # of a line, closer at its beginning; of a dip, and how often it is looked at closer
STEPS = 200  # of the search for a root, at most; it takes some 10

Slack = Callable[[float], float]


def last_held(slack: Slack, held: float, lost: float, tolerance: float) -> float:
    """A place that holds, and is no farther than `tolerance` from one that does not.

    Args:
        slack: >= 0 at `held`, negative at `lost`.

    The regula falsi, whose older end counts half (Dowell and Jarratt 1971), and every third time the middle.
    """
    above, below, newest = slack(held), slack(lost), 0
    for step in range(STEPS):
        length = lost - held
        if abs(length) <= tolerance:
            break
        share = above / (above - below) if np.isfinite(below) and step % 3 < 2 else 0.5
        least = 0.7 * tolerance / abs(length)
        place = held + length * min(max(share, min(least, 0.5)), max(1.0 - least, 0.5))
        value = slack(place)
        if value >= 0.0:
            held, above, below = place, value, 0.5 * below if newest > 0 else below
        else:
            lost, below, above = place, value, 0.5 * above if newest < 0 else above
        newest = 1 if value >= 0.0 else -1
    return held


def first_loss(slack: Slack, start: float, end: float, tolerance: float) -> float | None:
    """The last place from `start` on, towards `end`, up to which all holds; None if nothing is lost up to the end.

    It is found if the slack, between two of its samples, has no dip beside the one that they show: it is rational in
    what varies, of a low degree.

    Args:
        slack: >= 0 at `start`.
    """
    places = start + (end - start) * np.linspace(0.0, 1.0, SAMPLES + 1) ** 2
    values = [slack(float(place)) for place in places]
    for i in range(1, SAMPLES + 1):
        if values[i] < 0.0:
            return last_held(slack, float(places[i - 1]), float(places[i]), tolerance)
        if i < SAMPLES and values[i] <= min(values[i - 1], values[i + 1]):
            lowest = _dip(slack, float(places[i - 1]), float(places[i + 1]))
            if slack(lowest) < 0.0:
                return last_held(slack, float(places[i - 1]), lowest, tolerance)
    return None


def _dip(slack: Slack, first: float, last: float) -> float:
    """The lowest place between two, of a slack with one dip there, or the first that is below 0."""
    for _ in range(DIPS):
        places = np.linspace(first, last, IN_A_DIP + 1)
        values = [slack(float(place)) for place in places]
        lowest = int(np.argmin(values))
        if values[lowest] < 0.0:
            return float(places[lowest])
        first, last = float(places[max(lowest - 1, 0)]), float(places[min(lowest + 1, IN_A_DIP)])
    return 0.5 * (first + last)
