"""Many ends of one flight: objects put back to how they were, or copies of the whole process.

Many hits begin from one moment of a flight, and none is copied.

All that can be reached from the roots and can change is noted, each object for itself. So views of an array, and two
names of one object, are again what they were. `copy.deepcopy` and `pickle` refuse parts of a vehicle and a guard, take
several times as long for the rest, and tear apart what compiled code shares.
"""

import json
import os
import random
from array import array
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import Enum
from functools import cache, partial
from operator import itemgetter
from struct import Struct
from types import BuiltinFunctionType, FunctionType, MemberDescriptorType, MethodType, ModuleType, NoneType
from typing import Any

import numpy as np
from pydantic import BaseModel

from bench.fly.campaign import Json

# Nothing in them changes: models are frozen, classes and modules are the program.
_LEAVES = (int, float, str, bytes, NoneType, Enum, type, ModuleType, BaseModel, Struct, itemgetter, slice, np.dtype)


class Moment:
    """How everything below some roots is now. `rewind` makes it so again, any number of times."""

    def __init__(self, *roots: object) -> None:
        self._steps: list[tuple[Callable[..., object], tuple[Any, ...]]] = []
        seen: dict[int, object] = {}
        waiting: list[Any] = list(roots)
        while waiting:
            found = waiting.pop()
            if id(found) not in seen and not isinstance(found, _LEAVES):
                seen[id(found)] = found
                waiting.extend(self._noted(found))
        self._kept = seen  # an object that went would leave its number to another

    def rewind(self) -> None:
        for function, arguments in self._steps:
            function(*arguments)

    def _noted(self, found: Any) -> Iterable[Any]:
        """Note one object; returns what it refers to. Raises TypeError for a kind that cannot be put back."""
        match found:
            case dict():
                self._steps.append((_refill, (found, dict(found))))
                return (*found, *found.values())
            case list() | bytearray() | array():
                self._steps.append((found.__setitem__, (slice(None), found[:])))
                return found if isinstance(found, list) else ()
            case deque() | set():
                content = tuple(found)
                add = found.extend if isinstance(found, deque) else found.update
                self._steps += [(found.clear, ()), (add, (content,))]
                return content
            case tuple() | frozenset():
                return found
            case np.ndarray() if found.base is None:
                self._steps.append((np.copyto, (found, found.copy())))
                return ()
            case np.ndarray() | np.void():
                return (found.base,)
            case np.random.Generator():
                bits = found.bit_generator
                self._steps.append((setattr, (bits, "state", bits.state)))
                return ()
            case random.Random():
                self._steps.append((found.setstate, (found.getstate(),)))
                return ()
            case MethodType() | BuiltinFunctionType():
                return (found.__self__,)
            case FunctionType():
                return [cell.cell_contents for cell in found.__closure__ or ()]
            case partial():
                return found.func, found.args, found.keywords
        return self._noted_instance(found)

    def _noted_instance(self, found: Any) -> Iterable[Any]:
        kind: Any = type(found)
        slots, has_dict = _slots(kind), hasattr(found, "__dict__")
        if not slots and not has_dict and kind.__basicsize__ > object.__basicsize__:
            raise TypeError(f"{kind.__module__}.{kind.__qualname__} cannot be put back")
        values = [(slot, slot.__get__(found)) for slot in slots if hasattr(found, slot.__name__)]
        frozen = "__dataclass_params__" in kind.__dict__ and kind.__dataclass_params__.frozen
        if not frozen:
            self._steps += [(slot.__set__, (found, value)) for slot, value in values]
            if has_dict:
                self._steps.append((_refill, (vars(found), dict(vars(found)))))
        return [value for _, value in values] + (list(vars(found).values()) if has_dict else [])


@cache
def _slots(kind: type) -> tuple[MemberDescriptorType, ...]:
    members = (member for base in kind.__mro__ for member in vars(base).values())
    return tuple(member for member in members if isinstance(member, MemberDescriptorType))


def _refill(content: dict[Any, Any], before: dict[Any, Any]) -> None:
    """An instance's own dict, too: emptied only where names were added, which would make it slow."""
    if len(content) != len(before):
        content.clear()
    content.update(before)


@dataclass(slots=True)
class Copies:
    """Copies of this process, made in the middle of a flight; each goes on by itself and ends with what it found."""

    found: dict[str, Json] = field(default_factory=dict)
    """In the first process, by the copy's name."""
    me: str | None = None
    """In a copy its name."""
    _pipe: int = -1

    def fork(self, name: str) -> bool:
        """Return in two processes: true in the copy, and false in the first one when the copy has ended."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            self.me, self._pipe = name, writing
            return True
        os.close(writing)
        with os.fdopen(reading) as pipe:
            text = pipe.read()
        os.waitpid(child, 0)
        self.found[name] = json.loads(text or '{"failure": "the copy died"}')
        return False

    def leave(self, find: Callable[[], Json]) -> None:
        """End a copy with what it found; the first process goes on."""
        if self.me is None:
            return
        try:
            with os.fdopen(self._pipe, "w") as pipe:
                pipe.write(json.dumps(find()))
        finally:
            os._exit(0)
