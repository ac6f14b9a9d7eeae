"""Named tuples that leave their annotations alone: typing compiles each, which is most of what such a class costs.

A command imports some forty of them, and start-up is part of the product.  A `Record` may have the fields of others,
all with defaults, between its own that must be given and its own that need not be.
"""

from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any, ClassVar, NamedTuple as NamedTuple, dataclass_transform  # noqa: PLC0414  given on

    @dataclass_transform(frozen_default=True, kw_only_default=True)
    class Record:
        """Its fields are given by name, and nothing changes them."""

        _fields: ClassVar[tuple[str, ...]]

        def _asdict(self) -> dict[str, Any]: ...
else:

    class _Made(type):
        def __new__(cls, name, bases, body):
            own = body.pop("__annotations__")
            given = {field: body.pop(field) for field in own if field in body}
            of_bases = [
                (field, one) for one in bases for field in getattr(one, "_fields", ())
            ]
            fields = [
                *(field for field in own if field not in given),
                *(field for field, _ in of_bases),
                *given,
            ]
            defaults = [
                *(one._field_defaults[field] for field, one in of_bases),
                *given.values(),
            ]
            made = namedtuple(
                name, fields, defaults=defaults, module=body.pop("__module__")
            )
            for key in body:
                setattr(made, key, body[key])
            return made

    NamedTuple = Record = type.__new__(_Made, "NamedTuple", (), {})
