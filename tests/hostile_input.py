"""Input that nobody should give: values of every kind, text of every shape, and files of which something is changed."""

import json
from decimal import Decimal
from typing import Any

import numpy as np
from hypothesis import strategies as st

NUMBERS = (
    0.0, -0.0, -1.0, 1e-320, 1e-300, 1e-16, 1e16, 1e150, 1e300, 1.7e308, float("nan"), float("inf"), 10**400,
)  # fmt: skip
OBJECTS = (
    True, None, "", "1", "nan", b"1", 1j, [], [[]], [1.0, [2.0]], {}, (2.0, 1.0), (1.0, 2.0), (1.0, float("nan")),
    Decimal(1), np.array([]), np.zeros((3, 3)), np.float32(0.5), np.array(["a"]), np.array([None]), object,
)  # fmt: skip
WORDS = (
    "nan", "inf", "-inf", "-1", "0", "1e999", "-1e-320", "0.8:1.2", "1.2:0.8", ":", "1:", ":1", "1:2:3", "nan:1",
    "1:inf", "2w", "nanw", "-1w", "1e400w", "w", "3T", "infT", "T", "1,2", "0x10", "1_0", " 1 ",
    "True", "none", "None", "\x00", "\n", "１", "é", "[1]", "{}", "=", "a=b",
)  # fmt: skip

USUAL = ("0.1", "0.5", "1", "2", "5", "30", "50", "0.5w", "2w", "1T", "0.9:1.1", "-0.005:0.005", "static", "arc")

values = st.one_of(
    st.sampled_from(NUMBERS), st.sampled_from(OBJECTS), st.floats(), st.integers(), st.text(max_size=4),
    st.lists(st.floats(), max_size=4),
)  # fmt: skip
words = st.one_of(st.sampled_from(WORDS), st.floats().map(repr), st.text(max_size=5))
seeds = st.integers(0, 2**32 - 1)


def spoilt(names: tuple[str, ...], most: int = 2) -> st.SearchStrategy[dict[str, Any]]:
    """Hostile values for none or a few of these arguments."""
    return st.dictionaries(st.sampled_from(names), values, max_size=most)


def settings(names: tuple[str, ...], most: int = 3) -> st.SearchStrategy[tuple[str, ...]]:
    """KEY=VALUE as on the command line, of which some are no such thing."""
    keys = st.one_of(st.sampled_from(names), st.sampled_from(names), st.text(max_size=4))
    pairs = st.one_of(st.tuples(keys, st.one_of(words, st.sampled_from(USUAL))).map("=".join), words)
    return st.one_of(pairs.map(lambda pair: (pair,)), st.lists(pairs, max_size=most).map(tuple))


def changed_text(text: str) -> st.SearchStrategy[str]:
    """A text with a piece cut out, put in or repeated."""
    where = st.integers(0, len(text))
    piece = st.one_of(words, st.sampled_from(['"', "<", ">", "/>", ",", "}", "]", "-1", "1e999", "\ufeff"]))
    cut = st.builds(lambda i, n, p: text[:i] + p + text[i + n :], where, st.integers(0, 12), piece)
    return st.one_of(cut, where.map(lambda i: text[:i]), st.builds(lambda i, n: text[:i] + text[i - n :], where, where))


def changed_bytes(data: bytes) -> st.SearchStrategy[bytes]:
    """Bytes of which one, or a few in a row, are others; or that are cut off; or of another file."""
    where = st.integers(0, len(data) - 1)
    put = st.builds(lambda i, b: data[:i] + b + data[i + len(b) :], where, st.binary(min_size=1, max_size=8))
    return st.one_of(put, put, where.map(lambda i: data[:i]), st.binary(max_size=20))


def changed_object(said: dict[str, Any]) -> st.SearchStrategy[str]:
    """JSON of an object of which an entry, or an entry of an entry, is another, or is missing."""
    plain = st.recursive(
        st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.sampled_from(WORDS)),
        lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=4), inner, max_size=3)),
        max_leaves=4,
    )
    names = [(name,) for name in said] + [
        (name, key) for name, inner in said.items() if isinstance(inner, dict) for key in inner
    ]

    def put(path: tuple[str, ...], value: Any, drop: bool) -> str:
        out = json.loads(json.dumps(said))
        inner = out
        for name in path[:-1]:
            inner = inner[name]
        if drop:
            del inner[path[-1]]
        else:
            inner[path[-1]] = value
        return json.dumps(out)

    return st.builds(put, st.sampled_from(names), plain, st.sampled_from((False, False, False, True)))
