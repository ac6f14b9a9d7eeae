"""Define data classes whose methods are not compiled for each class, because that takes most of their import time.

Python writes and compiles the code of five methods for each frozen data class (0.4 ms). A command imports some twenty
of them, and start-up is part of the product. Here, all classes share these methods. The rest is Python's.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # noqa: PLC0414  the name is exported
else:

    def dataclass(cls=None, /, **chosen):
        """Make a data class; the arguments are ``init``, ``repr``, ``eq``, ``frozen`` and ``kw_only`` of Python's."""
        if cls is None:
            return partial(dataclass, **chosen)
        own = {*vars(cls)}
        dataclasses.dataclass(
            init=False, repr=False, eq=False, kw_only=chosen.get("kw_only", False)
        )(cls)
        frozen = chosen.get("frozen", False)
        methods = {}
        if chosen.get("init", True):
            methods["__init__"] = _make_initialiser(cls)
        if chosen.get("repr", True):
            methods["__repr__"] = _describe
        if chosen.get("eq", True):
            methods["__eq__"] = _is_equal
            methods["__hash__"] = _compute_hash if frozen else None
        if frozen:
            methods["__setattr__"], methods["__delattr__"] = _set, _delete
        for name, method in methods.items():
            if name not in own:
                setattr(cls, name, method)
        return cls

    def _make_initialiser(cls):
        fields = [field for field in dataclasses.fields(cls) if field.init]
        ordered = [field.name for field in fields if not field.kw_only]
        names = {field.name for field in fields}
        missing = dataclasses.MISSING
        defaults, factories = {}, {}
        for field in dataclasses.fields(cls):
            if field.default is not missing:
                defaults[field.name] = field.default
            elif field.default_factory is not missing:
                factories[field.name] = field.default_factory
        required = names - {*defaults, *factories}
        finish = getattr(cls, "__post_init__", None)

        def __init__(self, /, *in_order, **by_name):  # noqa: N807  it is the method of a class
            given = dict(zip(ordered, in_order, strict=False))
            if not given.keys().isdisjoint(by_name):
                raise TypeError(f"{cls.__name__}: a field is given twice")
            given.update(by_name)
            if len(in_order) > len(ordered):
                raise TypeError(f"{cls.__name__}: too many fields in order")
            if not names >= given.keys() >= required:
                wrong = sorted((given.keys() - names) | (required - given.keys()))
                raise TypeError(
                    f"{cls.__name__}: unknown or missing: {', '.join(wrong)}"
                )
            values = vars(self)
            values.update(defaults)
            for name, make in factories.items():
                if name not in given:
                    values[name] = make()
            values.update(given)
            if finish:
                finish(self)

        return __init__

    def _list_values(record, purpose):
        return tuple(
            getattr(record, field.name)
            for field in dataclasses.fields(record)
            if getattr(field, purpose)
        )

    def _describe(self):
        names = [field.name for field in dataclasses.fields(self) if field.repr]
        values = map("{}={!r}".format, names, _list_values(self, "repr"))
        return f"{type(self).__qualname__}({', '.join(values)})"

    def _is_equal(self, other):
        if type(self) is not type(other):
            return NotImplemented
        return _list_values(self, "compare") == _list_values(other, "compare")

    def _compute_hash(self):
        return hash(_list_values(self, "compare"))

    def _set(self, name, value):
        _refuse_change(self, name)
        object.__setattr__(self, name, value)

    def _delete(self, name):
        _refuse_change(self, name)
        object.__delattr__(self, name)

    def _refuse_change(record, name):
        # A subclass that is no data class itself may have further attributes.
        fields = record.__dataclass_fields__
        if name in fields or vars(type(record)).get("__dataclass_fields__") is fields:
            raise dataclasses.FrozenInstanceError(f"cannot change {name!r}")
