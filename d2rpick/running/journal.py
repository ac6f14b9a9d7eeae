"""What was done of a run, one line of JSON each, so that it goes on where it was whatever ended it."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from d2rpick.base.errors import D2RPickError
from d2rpick.base.files import record_of, signed

if TYPE_CHECKING:
    from pathlib import Path


class Journal:
    """Records that are only appended, each on the disk when `add` returns.

    A line that is cut or damaged is passed over: what it said was not done.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes() if path.exists() else b""
        self.records = [record for line in content.split(b"\n") if (record := record_of(line))]
        self._end = b"\n" if content and not content.endswith(b"\n") else b""

    def add(self, event: str, **values: Any) -> dict[str, Any]:
        """Append a record; D2RPickError where there is no room for it."""
        record = {"event": event, **values}
        size = self.path.stat().st_size if self.path.exists() else 0
        try:
            with self.path.open("ab") as file:
                file.write(self._end + signed(json.dumps(record, allow_nan=False)).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            with suppress(OSError):
                os.truncate(self.path, size)
            raise D2RPickError(f"{self.path}: cannot be written ({error.strerror}); make room, then --resume") from None
        self._end = b""
        self.records.append(record)
        return record

    def all(self, event: str) -> list[dict[str, Any]]:
        """Records of one kind, in the order they were written."""
        return [record for record in self.records if record["event"] == event]
