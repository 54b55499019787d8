"""How a key is declared: once, as a dataclass field that carries what the key means and may be.

    mu: float | None = key(None, "friction coefficient", group=OBJECT, above=0.0, none="as the scene has it")

How text is read, what is refused, `--help`, the docstrings and the summary's changes follow from these fields, so that
a new key needs nothing but its field.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from textwrap import TextWrapper
from types import MappingProxyType, NoneType
from typing import Any, TypeVar, get_args

import numpy as np
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import fail, number, one_of
from pivoting.sim.scenarios.intervals import KIND, read_interval
from pivoting.sim.scenarios.relative_values import MEANING, multiple

T = TypeVar("T")
MOST_TIMES = 1e12  # weights, or natural times, that are asked for
_METADATA = "key"  # of a field, under which its `Key` is
_SIGNS = {"above": ">", "at_least": ">=", "below": "<", "at_most": "<="}


@dataclass(frozen=True)
class Needs:
    """What a key has an effect with: another key that is set, or that is one of certain words.

    Attributes:
        key: the other key.
        words: what that has to be, or a function that tells it of the first key's name; None: anything but None and 0.
        open_loop: whether the key has an effect in a run in open loop, too.
        said: the condition in words, where `key` is an attribute of the values but no key.
        instead: other keys, any of which will do as well, if it is set.
    """

    key: str
    words: tuple[str, ...] | Callable[[str], tuple[str, ...]] | None = None
    open_loop: bool = False
    said: str = ""
    instead: tuple[str, ...] = ()

    def met(self, name: str, values: object, open_loop: bool) -> bool:
        """Whether the key `name` has an effect among these values, attributes of an object, in open loop or not."""
        value, words = getattr(values, self.key), self.words_of(name)
        others = any(getattr(values, other) for other in self.instead)
        return (open_loop and self.open_loop) or others or (bool(value) if words is None else value in words)

    def words_of(self, name: str) -> tuple[str, ...] | None:
        """The words with one of which the key `name` has an effect."""
        return self.words(name) if callable(self.words) else self.words

    def condition(self, name: str) -> str:
        """The condition for the key `name`, in words."""
        if self.said:
            return self.said
        words = self.words_of(name)
        if words is None:
            keys = " or ".join((self.key, *self.instead))
            return f"{keys} is set" + " or the run is in open loop" * self.open_loop
        return f"{self.key} is " + " or ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


@dataclass(frozen=True)
class Key:
    """What a key means and may be.

    Attributes:
        help: what it means.
        default: its value, where nothing else is given.
        group: what it is a key of, the title of a section of `--help`.
        unit: of a number.
        limits: of a number, see `validate.number`.
        none: what None means, in words; "" where None is not allowed.
        relative: what a number may be relative to, "w" or "T", see `relative_values.MEANING`; "" if to nothing.
        words: what it may be, if it is a word, each with what it means (as its `str`).
        needs: what it has an effect with; None: it always has one.
        stages: the classes that are built from the value as stages of the pipeline, "module:Class"; 0 or None asks for
            none. Several keys may name one class, which finds the others' values in its `Setting`.
        types: of the field's annotation, such as (float, NoneType).
    """

    help: str
    default: Any
    group: str
    unit: str = ""
    limits: Mapping[str, float] = field(default_factory=dict)
    none: str = ""
    relative: str = ""
    words: Mapping[str, object] | None = None
    needs: Needs | None = None
    stages: tuple[str, ...] = ()
    types: tuple[Any, ...] = ()

    @property
    def optional(self) -> bool:
        """Whether it may be None."""
        return NoneType in self.types

    @property
    def whole(self) -> bool:
        """Whether it is a whole number."""
        return int in self.types

    @property
    def ranged(self) -> bool:
        """Whether it may be an interval."""
        return Interval in self.types

    @property
    def allowed(self) -> str:
        """What it may be, in a few words."""
        if self.words is not None:
            return ", ".join(word + f" ({meaning})" * bool(str(meaning)) for word, meaning in self.words.items())
        within = " and ".join(f"{_SIGNS[bound]} {value:g}" for bound, value in self.limits.items())
        also = (f", or 2{self.relative}" if self.relative else "") + ", or LOW:HIGH" * self.ranged
        return within + (f" {self.unit}" if self.unit else "") + also

    @property
    def kind(self) -> str:
        """What is asked for, where text is none of it."""
        if self.ranged:
            return KIND
        return "a number" + (f", or in {MEANING[self.relative]}" if self.relative else "")

    def read(self, name: str, value: Any) -> Any:
        """The value of the key, which is called `name` in errors, from text if need be; what is relative stays text.

        Raises:
            ValueError: text that is no number, where one is asked for.
        """
        if self.ranged:
            value = read_interval(name, value)
        if self.words is not None or not isinstance(value, str):
            return value
        if multiple(value, self.relative) is not None:
            return value.strip()
        try:
            read = float(value)
        except ValueError:
            raise fail(name, value, self.kind) from None
        return int(read) if self.whole and read.is_integer() else read

    def check(self, name: str, value: Any, **limits: float) -> None:
        """Raise unless the key, which is called `name` in errors, may have this value.

        Args:
            limits: of a number, in place of the key's own.
        """
        if self.words is not None:
            if isinstance(value, str) or not (self._takes_objects and callable(value)):
                one_of(name, value, tuple(self.words))
        elif self.ranged and isinstance(value, Interval):
            for end in value:
                self.check(name, end, **limits)
        elif value is not None or not self.optional:
            times = multiple(value, self.relative)
            if times is None:
                number(name, value, unit=self.unit, **(limits or self.limits))
            elif not (np.isfinite(times) and (times > 0.0 if "above" in self.limits else times >= 0.0)):
                raise fail(name, value, f"{self.kind}, finite and {'>' if 'above' in self.limits else '>='} 0")
            elif times > MOST_TIMES:
                raise fail(name, value, f"at most {MOST_TIMES:g}{self.relative}")
            if self.whole and not float(value).is_integer():
                raise fail(name, value, "a whole number")

    @property
    def _takes_objects(self) -> bool:
        """Whether the annotation has a type besides words and numbers."""
        return bool(set(self.types) - {str, int, float, NoneType})


def key(
    default: T,
    help: str,
    *,
    group: str,
    unit: str = "",
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    none: str = "",
    relative: str = "",
    words: Mapping[str, object] | None = None,
    needs: Needs | None = None,
    stage: str | tuple[str, ...] = (),
) -> T:
    """The field of a dataclass that declares a key; see `Key`."""
    bounds = {"above": above, "at_least": at_least, "below": below, "at_most": at_most}
    limits = {name: bound for name, bound in bounds.items() if bound is not None}
    stages = (stage,) if isinstance(stage, str) else stage
    declared = Key(help, default, group, unit, limits, none, relative, words, needs, stages)
    return field(default=default, metadata={_METADATA: declared})


def declared_keys(cls: type) -> Mapping[str, Key]:
    """The keys that the fields of a dataclass declare, by name, in their order.

    Raises:
        TypeError: the declaration of a key contradicts its type.
    """
    return _declared(cls)


@cache
def _declared(cls: type) -> Mapping[str, Key]:
    found = {}
    for each in fields(cls):
        if _METADATA in each.metadata:
            declared = replace(each.metadata[_METADATA], types=get_args(each.type) or (each.type,))
            if declared.optional != bool(declared.none):
                raise TypeError(f"{cls.__name__}.{each.name}: none= says what None means, if and only if it is allowed")
            if (str in declared.types) != (declared.words is not None or bool(declared.relative)):
                raise TypeError(
                    f"{cls.__name__}.{each.name}: text is allowed if and only if it has words or is relative"
                )
            found[each.name] = declared
    return MappingProxyType(found)


def described(cls: type) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """The keys of a dataclass by their groups, each with what it means, what it may be, and its default."""
    keys = declared_keys(cls)
    for group in dict.fromkeys(each.group for each in keys.values()):
        yield group, [(name, _line(name, keys)) for name, each in keys.items() if each.group == group]


def documented(cls: type[T]) -> type[T]:
    """A dataclass whose docstring goes on with its keys."""
    lines, wrapped = [], TextWrapper(120, initial_indent=8 * " ", subsequent_indent=12 * " ", break_on_hyphens=False)
    for group, rows in described(cls):
        lines += ["", f"    Keys of {group}:", *(wrapped.fill(f"{name}: {line}") for name, line in rows)]
    cls.__doc__ = (cls.__doc__ or "").rstrip() + "\n" + "\n".join(lines) + "\n"
    return cls


def _line(name: str, keys: Mapping[str, Key]) -> str:
    each, condition = keys[name], ""
    if each.needs is not None:
        words = each.needs.words_of(name)
        if words is None or set(words) != set(keys[each.needs.key].words or ()):
            condition = f"; only if {each.needs.condition(name)}"
    default = each.none if each.default is None else each.default
    shown = f"{default:.4g}" if isinstance(default, float) else default
    return f"{each.help} [{each.allowed}; default: {shown}{condition}]"
