"""Many ends of one flight: copies of the whole process, made in the middle of it."""

import json
import os
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(slots=True)
class Copies:
    """Each goes on by itself and ends with what it found."""

    found: dict[str, Any] = field(default_factory=dict)
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
        self.found[name] = json.loads(text or '{"error": "the copy died"}')
        return False

    def leave(self, find: Callable[[], Any]) -> None:
        """End a copy with what it found, or with the error that it met; the first process goes on."""
        if self.me is None:
            return
        try:
            found = find()
        except BaseException:
            found = {"error": traceback.format_exc()}
        try:
            with os.fdopen(self._pipe, "w") as pipe:
                pipe.write(json.dumps(found))
        finally:
            os._exit(0)


def in_a_copy(work: Callable[[], Any]) -> Any:
    """What becomes of this instant, in a copy of the process: a simulated vehicle cannot be copied alone."""
    copies = Copies()
    if copies.fork("copy"):
        copies.leave(work)
    return copies.found["copy"]
