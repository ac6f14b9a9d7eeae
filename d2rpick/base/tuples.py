"""Define named tuples whose annotations are not evaluated, because evaluation takes most of the import time.

A command imports some forty of them, and start-up is part of the product. A `Record` may inherit fields of other
records (all with defaults), which come between its own fields without and with defaults.
"""

from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any, ClassVar, NamedTuple as NamedTuple, dataclass_transform  # noqa: PLC0414  the name is exported

    @dataclass_transform(frozen_default=True, kw_only_default=True)
    class Record:
        """A named tuple whose fields are given by keyword."""

        _fields: ClassVar[tuple[str, ...]]

        def _asdict(self) -> dict[str, Any]: ...
else:

    class _Made(type):
        def __new__(cls, name, bases, body):
            annotated = body.pop("__annotations__")
            own_defaults = {key: body.pop(key) for key in annotated if key in body}
            inherited, inherited_defaults = [], []
            for base in bases:
                for field in getattr(base, "_fields", ()):
                    inherited.append(field)
                    inherited_defaults.append(base._field_defaults[field])
            required = [field for field in annotated if field not in own_defaults]
            fields = [*required, *inherited, *own_defaults]
            defaults = [*inherited_defaults, *own_defaults.values()]
            record = namedtuple(
                name, fields, defaults=defaults, module=body.pop("__module__")
            )
            for key in body:
                setattr(record, key, body[key])
            return record

    NamedTuple = Record = type.__new__(_Made, "NamedTuple", (), {})
