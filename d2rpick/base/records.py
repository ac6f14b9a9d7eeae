"""Records without code that Python compiles for each: it is most of what a dataclass or a named tuple costs.

A command imports some seventy of them, and start-up is part of the product.  Dataclasses of decks and rules are those
of the standard library: thousands are made, each 1 us quicker.
"""

from __future__ import annotations

import dataclasses
from collections import namedtuple
from dataclasses import MISSING, field, fields, replace
from typing import TYPE_CHECKING

__all__ = ["NamedTuple", "dataclass", "field", "fields", "replace"]

if TYPE_CHECKING:
    from dataclasses import dataclass
    from typing import NamedTuple
else:

    class _Made(type):
        """Leaves annotations alone, which typing compiles."""

        def __new__(cls, name, _, body):
            names = body.pop("__annotations__")
            defaults = [body.pop(one) for one in names if one in body]
            made = namedtuple(name, names, defaults=defaults, module=body.pop("__module__"))
            for key in body:
                setattr(made, key, body[key])
            return made

    NamedTuple = type.__new__(_Made, "NamedTuple", (), {})

    class _Signature:
        """What a dataclass is made of, said when it is asked for."""

        def __get__(self, _, cls):
            from inspect import Parameter, Signature

            every = sorted((one for one in fields(cls) if one.init), key=lambda one: one.kw_only)
            kinds = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
            made = [Parameter(one.name, kinds[one.kw_only], annotation=one.type) for one in every]
            for place, one in enumerate(every):
                if one.default_factory is not MISSING:
                    made[place] = made[place].replace(default=dataclasses._HAS_DEFAULT_FACTORY)
                elif one.default is not MISSING:
                    made[place] = made[place].replace(default=one.default)
            return Signature(made, return_annotation=None)

    def dataclass(*, frozen=False, eq=True, **other):
        """Do what that of the standard library does; a default that is not given otherwise stays one of the class."""

        def made(cls):
            dataclasses.dataclass(init=False, eq=eq, unsafe_hash=frozen and eq, **other)(cls)
            every = fields(cls)
            known = {one.name for one in every if one.init}
            makers = {one.name: one.default_factory for one in every if one.default_factory is not MISSING}
            needed = {one.name for one in every if one.default is MISSING} - makers.keys()
            order = [one.name for one in every if one.init and not one.kw_only]
            checks = hasattr(cls, "__post_init__")

            def init(self, *args, **named):
                given = len(args) + len(named)
                named.update(zip(order, args, strict=False))
                if len(named) < given or not (known.issuperset(named) and named.keys() >= needed):
                    raise TypeError(f"{cls.__name__} is made of {', '.join(sorted(known))}; found {args} and {named}")
                for name, make in makers.items():
                    if name not in named:
                        named[name] = make()
                self.__dict__.update(named)
                if checks:
                    self.__post_init__()

            def refuse(self, name, *value):
                if type(self) is cls or name in self.__dataclass_fields__:
                    raise dataclasses.FrozenInstanceError(f"cannot {'assign to' if value else 'delete'} field {name!r}")
                (super(cls, self).__setattr__ if value else super(cls, self).__delattr__)(name, *value)

            cls.__init__, cls.__signature__ = init, _Signature()
            if frozen:
                cls.__setattr__ = cls.__delattr__ = refuse
            return cls

        return made
