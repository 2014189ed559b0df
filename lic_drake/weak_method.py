"""Methods as functions that do not keep their objects alive."""

from collections.abc import Callable
from weakref import WeakMethod


def weakly[**P, R](method: Callable[P, R]) -> Callable[P, R]:
    """Returns a bound method as a function that its object does not live by.

    What Drake 1.58 holds in C++ - costs and constraints of programs, calculations of abstract
    output ports - is invisible to Python's collector: an object whose own method is there lives for
    ever, and with it the diagrams that it knows.

    Args:
        method: A bound method; its object has to live when the function is called.
    """
    weak = WeakMethod(method)

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = weak()
        assert bound is not None
        return bound(*args, **kwargs)

    return call
