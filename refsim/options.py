"""Options of methods: a name, a default, a sentence, and the check that turns what was given into what is used."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.errors import InputError


@dataclass(frozen=True)
class Option:
    """An option of a method: `check(value)` returns the value to use or raises `InputError`."""

    name: str
    default: Any
    sentence: str
    check: Callable[[Any], Any]


def choice(name: str, default: Any, values: tuple[Any, ...], sentence: str) -> Option:
    """One of `values`."""

    def check(value: Any) -> Any:
        single = object() if isinstance(value, np.ndarray) and value.ndim else value  # an array is none of them
        for allowed in values:
            if single == allowed and isinstance(value, bool) == isinstance(allowed, bool):
                return allowed
        known = ", ".join(repr(allowed) for allowed in values)
        raise InputError(f"{name} is {value!r}; it must be one of {known}.")

    return Option(name, default, sentence, check)


def whole(name: str, default: int | None, low: int, high: int, sentence: str) -> Option:
    """A whole number in [low, high], or None where that is the default."""

    def check(value: Any) -> Any:
        if value is None and default is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
            raise InputError(f"{name} is {value!r}; it must be a whole number from {low} to {high}.")
        return int(value)

    return Option(name, default, sentence, check)


def real(name: str, default: float, low: float, high: float, sentence: str) -> Option:
    """A finite number in (low, high]."""

    def check(value: Any) -> float:
        is_number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
        if not is_number or not low < float(value) <= high:
            raise InputError(f"{name} is {value!r}; it must be a number above {low:g} and at most {high:g}.")
        return float(value)

    return Option(name, default, sentence, check)


def checked(owner: str, options: Iterable[Option], given: Mapping[str, Any]) -> dict[str, Any]:
    """Every option's value, defaults included. An unknown name is refused with the nearest known one."""
    known = {option.name: option for option in options}
    for name in given:
        if name not in known:
            raise InputError(f"{owner} has no option {name!r}; {nearest(name, known)}.")
    return {name: option.check(given.get(name, option.default)) for name, option in known.items()}


def nearest(name: object, known: Iterable[str]) -> str:
    """A phrase that helps: the closest name, or all of them."""
    names = list(known)
    close = difflib.get_close_matches(str(name), names, 1)
    return f"did you mean {close[0]!r}" if close else f"choose from {', '.join(sorted(names))}"
