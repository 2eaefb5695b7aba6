"""Orders to a vehicle that flies in a thread of its own: they are carried out between two intervals."""

import queue
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

Answer = TypeVar("Answer")


class Control:
    """Pause, speed and any other order, from any thread."""

    def __init__(self, speed: float = 1.0) -> None:
        """``speed``: how many times faster than the clock, at most; 0 for as fast as the machine allows."""
        self.speed = speed
        self.is_paused = False
        self._orders: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = queue.SimpleQueue()

    def ask(self, order: Callable[[], Answer]) -> "Future[Answer]":
        """Have something done by the vehicle's thread; the result, or what went wrong, comes in the future."""
        future: Future[Answer] = Future()
        self._orders.put((order, future))
        return future

    def carry_out(self, wait_s: float = 0.0) -> None:
        """Do what has been asked, waiting for a first order at most so long."""
        try:
            waits = wait_s > 0.0
            while True:
                order, future = self._orders.get(waits, wait_s) if waits else self._orders.get_nowait()
                waits = False
                try:
                    future.set_result(order())
                except Exception as problem:
                    future.set_exception(problem)
        except queue.Empty:
            return

    def refuse(self, problem: Exception) -> None:
        """Nobody will do what is still asked."""
        while True:
            try:
                self._orders.get_nowait()[1].set_exception(problem)
            except queue.Empty:
                return
