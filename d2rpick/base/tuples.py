"""Define named tuples whose methods are not compiled for each class, because that takes most of their import time.

A command imports some forty of them, and start-up is part of the product. A `Record` may inherit fields of other
records (all with defaults), which come between its own fields without and with defaults.
"""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any, ClassVar, NamedTuple as NamedTuple, dataclass_transform  # noqa: PLC0414  the name is exported

    @dataclass_transform(frozen_default=True, kw_only_default=True)
    class Record:
        """A named tuple whose fields are given by keyword."""

        _fields: ClassVar[tuple[str, ...]]

        def _asdict(self) -> dict[str, Any]: ...
else:

    class _Tuple(tuple):
        """What all named tuples share; it is that of `collections.namedtuple`."""

        __slots__ = ()

        def __new__(cls, /, *in_order, **by_name):
            if by_name or len(in_order) != len(cls._fields):
                in_order = cls._complete(in_order, by_name)
            return tuple.__new__(cls, in_order)

        @classmethod
        def _complete(cls, in_order, by_name):
            values = {**cls._field_defaults, **by_name}
            rest = cls._fields[len(in_order) :]
            try:
                if len(in_order) <= len(cls._fields) and {*rest}.issuperset(by_name):
                    return (*in_order, *[values[field] for field in rest])
            except KeyError:
                pass
            raise TypeError(
                f"{cls.__name__}: expected {', '.join(cls._fields)}; "
                f"given are {len(in_order)} in order, and {', '.join(by_name) or 'none'} by name"
            )

        @classmethod
        def _make(cls, values):
            return cls(*values)

        def _replace(self, /, **changes):
            changed = tuple.__new__(type(self), map(changes.pop, self._fields, self))
            if changes:
                raise TypeError(f"{type(self).__name__}: no field {', '.join(changes)}")
            return changed

        def _asdict(self):
            return dict(zip(self._fields, self, strict=True))

        def __repr__(self):
            values = map("{}={!r}".format, self._fields, self)
            return f"{type(self).__name__}({', '.join(values)})"

        def __getnewargs__(self):
            return tuple(self)

    class _Made(type):
        def __new__(cls, name, bases, body):
            annotated = body.pop("__annotations__")
            own_defaults = {key: body.pop(key) for key in annotated if key in body}
            inherited = {}
            for base in bases:
                inherited |= getattr(base, "_field_defaults", {})
            required = [field for field in annotated if field not in own_defaults]
            fields = (*required, *inherited, *own_defaults)
            body |= {
                "__slots__": (),
                "__match_args__": fields,
                "_fields": fields,
                "_field_defaults": inherited | own_defaults,
            }
            for place, field in enumerate(fields):
                body[field] = property(itemgetter(place))
            return type(name, (_Tuple,), body)

    NamedTuple = Record = type.__new__(_Made, "NamedTuple", (), {})
