"""YAML that nobody vouches for, as plain data or as one clear error."""

from typing import Any

import yaml

MAX_DEPTH = 50
"""Deeper nesting is refused."""


class _PlainLoader(yaml.SafeLoader):  # type: ignore[misc]
    """Builds plain data only, and refuses what could make a short text endless."""

    _depth = 0

    def fetch_flow_collection_start(self, token: Any) -> None:
        """Reads an opening bracket; the scanner sees all of them before any node is there."""
        self._check_depth(self.flow_level)
        super().fetch_flow_collection_start(token)

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Reads a node that is no alias: aliases of aliases unfold to any length."""
        if self.check_event(yaml.AliasEvent):
            raise ValueError(f"the alias *{self.peek_event().anchor} is not allowed; write it out")
        self._check_depth(self._depth)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    @staticmethod
    def _check_depth(depth: int) -> None:
        if depth >= MAX_DEPTH:
            raise ValueError(f"it is nested more than {MAX_DEPTH} levels deep")


def parse_yaml(text: str | bytes) -> Any:
    """Returns the data in YAML text; nothing in it is executed.

    Raises:
        ValueError: It is not YAML in UTF-8, nested too deeply, or has tags or aliases.
    """
    try:
        return yaml.load(text, Loader=_PlainLoader)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise ValueError(" ".join(str(error).split())) from None
