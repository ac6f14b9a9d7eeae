"""Provide the ``cached_property`` of Python 3.12 for Python 3.11, whose own version locks at each access."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING or sys.version_info >= (3, 12):
    from functools import cached_property as cached_property  # noqa: PLC0414, TID251  the name is exported
else:

    class cached_property:  # noqa: D101, N801  this class copies functools.cached_property
        def __init__(self, function):
            self._function, self.__doc__ = function, function.__doc__

        def __set_name__(self, owner, name):
            self._name = name

        def __get__(self, instance, owner=None):
            if instance is None:
                return self
            value = instance.__dict__[self._name] = self._function(instance)
            return value
