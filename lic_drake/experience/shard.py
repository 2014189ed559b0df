"""`Shard`: the share of a collection that one collector of a job array does."""

from dataclasses import dataclass
from typing import Self

from lic_drake.errors import RequestError


@dataclass(frozen=True)
class Shard:
    """Every `count`-th environment of a collection, from the `index`-th on.

    Attributes:
        index: Which share, 1 to `count`.
        count: Number of shares.

    Raises:
        RequestError: The index is out of range.
    """

    index: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.index <= self.count:
            raise RequestError(
                f"a shard is k/n with k from 1 to n, got {self}; start the job array at 1"
            )

    @classmethod
    def parse(cls, text: str) -> Self:
        """Reads "k/n".

        Raises:
            RequestError: The text is something else.
        """
        index, _, count = text.partition("/")
        if not (index.isdecimal() and count.isdecimal()):
            raise RequestError(
                f"a shard is k/n with k from 1 to n, for instance 3/20, got {text!r}"
            )
        return cls(int(index), int(count))

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    def share(self, environments: range) -> range:
        """Returns this share of the environments of a collection."""
        return environments[self.index - 1 :: self.count]


WHOLE = Shard()
"""The whole collection as one share."""
