"""Dataclasses that are made quickly: start-up is part of the product.

The standard library compiles six methods for each frozen class, which took a third of what ``check`` of a small deck
takes.  Here one is compiled, and the others are shared; ``fields``, ``replace`` and pickles are as ever.
"""

from __future__ import annotations

import dataclasses
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from collections.abc import Callable
    from dataclasses import dataclass
else:

    def dataclass(*, frozen: bool = False, eq: bool = True, repr: bool = True, kw_only: bool = False):  # noqa: A002
        """Do what that of the standard library does."""

        def made(cls):
            cls = dataclasses.dataclass(init=False, repr=False, eq=False, kw_only=kw_only)(cls)
            methods = {"__init__": _init(cls)}
            if repr:
                methods["__repr__"] = _repr
            if eq:
                methods |= _comparisons(cls, frozen)
            if frozen:
                methods |= {"__setattr__": _refuse, "__delattr__": _refuse}
            for name, method in methods.items():
                if name not in vars(cls):
                    setattr(cls, name, method)
            return cls

        return made


def _init(cls: type) -> Callable[..., None]:
    """Compile what sets the fields, from arguments or as their defaults say."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_unset": dataclasses.MISSING}
    arguments: dict[bool, list[str]] = {False: ["self"], True: []}
    lines = []
    for one in dataclasses.fields(cls):
        name, default, factory = one.name, f"_default_{one.name}", f"_make_{one.name}"
        known |= {default: one.default, factory: one.default_factory}
        made = one.default_factory is not dataclasses.MISSING
        if one.init:
            has_default = made or one.default is not dataclasses.MISSING
            arguments[one.kw_only is True].append(f"{name}={default}" if has_default else name)
            value = f"{factory}() if {name} is _unset else {name}" if made else name
        elif made:
            value = f"{factory}()"
        else:
            continue
        lines.append(f"_set(self, {name!r}, {value})")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    both = ", ".join([*arguments[False], *["*"][: len(arguments[True])], *arguments[True]])
    exec(f"def __init__({both}):\n " + "\n ".join(lines or ["pass"]), known)
    init: Callable[..., None] = known["__init__"]
    init.__qualname__ = f"{cls.__qualname__}.__init__"
    return init


def _comparisons(cls: type, frozen: bool) -> dict[str, Callable[..., Any] | None]:
    values = attrgetter("__class__", *(one.name for one in dataclasses.fields(cls) if one.compare))

    def equal(self: object, other: object) -> bool:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return {"__eq__": equal, "__hash__": (lambda self: hash(values(self))) if frozen else None}


@recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{one.name}={getattr(self, one.name)!r}" for one in dataclasses.fields(self) if one.repr)
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _refuse(self: Any, name: str, *value: object) -> None:
    """Refuse to set or to delete; a derived class that is no dataclass may have attributes of its own."""
    if name in self.__dataclass_fields__ or "__dataclass_fields__" in vars(type(self)):
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    (object.__setattr__ if value else object.__delattr__)(self, name, *value)
