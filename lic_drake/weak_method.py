"""Callbacks for Drake that do not keep their objects alive."""

from collections.abc import Callable
from weakref import WeakMethod


def weakly[**P, R](method: Callable[P, R]) -> Callable[P, R]:
    """Wraps a bound method so that the wrapper holds only a weak reference to its object.

    Callbacks that Drake 1.58 holds in C++ (costs, constraints, abstract output ports) are invisible
    to Python's garbage collector: an object whose own method is among them is never freed, nor are
    the diagrams it refers to. The object must be alive when the wrapper is called.
    """
    weak = WeakMethod(method)

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = weak()
        assert bound is not None
        return bound(*args, **kwargs)

    return call
