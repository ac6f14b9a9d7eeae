"""What all answers of the library have in common: the JSON document of the command line."""

from __future__ import annotations

import json
from typing import Any


class Document:
    """An answer that can be written as the command line writes it."""

    def to_json(self) -> str:
        """Give the JSON document of the command line."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Give the JSON document of the command line as a dictionary; its schema is named in it."""
        found: dict[str, Any] = json.loads(self.to_json())
        return found
