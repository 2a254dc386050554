"""A ``dataclass`` like the standard library's, whose methods aren't compiled until they are called.

The standard one writes and compiles the source of each method of each class when that is defined: up to a
millisecond a class, and a run imports two hundred of them before it has taken its first step. Here all
classes share the methods, and only ``__init__`` is compiled, when the first instance is made.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import MISSING, FrozenInstanceError
from operator import attrgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what type checkers and editors are to see
    from dataclasses import dataclass
else:

    def dataclass(cls: type | None = None, /, *, frozen: bool = False, repr: bool = True) -> Any:
        """Like ``dataclasses.dataclass`` with the same options, of which there are fewer.

        ``fields``, ``replace`` and ``asdict`` of the standard library work as usual. All fields are arguments
        of ``__init__``.

        Raises:
            TypeError: the class has a ``__post_init__``, which wouldn't be called, or a field that is no
                argument or comes by its name alone.
        """

        def made(cls: type) -> type:
            dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
            _refuse_what_is_missing(cls)
            methods = {"__init__": _first_init(cls), "__eq__": _equal, "__signature__": _Signature()}
            if cls.__dict__.get("__hash__") is None:  # none of its own; None beside an __eq__ of its own
                methods["__hash__"] = _hash if frozen else None
            if repr:
                methods["__repr__"] = _shown
            if frozen:
                methods |= {"__setattr__": _refuse_change, "__delattr__": _refuse_change}
            for name, method in methods.items():
                if name == "__hash__" or name not in cls.__dict__:
                    setattr(cls, name, method)
            return cls

        return made if cls is None else made(cls)


def _refuse_what_is_missing(cls: Any) -> None:
    if hasattr(cls, "__post_init__"):
        raise TypeError(f"{cls.__name__} has a __post_init__: use the standard library's dataclass")
    for field in dataclasses.fields(cls):
        if (
            not field.init and field.default is MISSING and field.default_factory is MISSING
        ) or field.kw_only:
            raise TypeError(f"{cls.__name__}.{field.name}: use the standard library's dataclass")


def _first_init(cls: type) -> Callable[..., None]:
    """An ``__init__`` that replaces itself by the compiled one."""

    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        cls.__init__ = init = _compiled_init(cls)  # type: ignore[misc]
        init(self, *args, **kwargs)

    return __init__


def _compiled_init(cls: Any) -> Callable[..., None]:
    """The ``__init__`` that takes the fields in order and sets them, in frozen classes too."""
    scope: dict[str, Any] = {"_set": object.__setattr__, "_missing": MISSING}
    given, lines = [], []
    for field in dataclasses.fields(cls):
        name, value = field.name, field.name
        if field.default_factory is not MISSING:
            scope[f"_new_{name}"] = field.default_factory
            value = f"_new_{name}() if {name} is _missing else {name}"
            given.append(f"{name}=_missing")
        elif field.default is not MISSING:
            scope[f"_default_{name}"] = field.default
            given.append(f"{name}=_default_{name}")
        else:
            given.append(name)
        lines.append(f"    _set(self, {name!r}, {value})\n")
    exec(f"def __init__({', '.join(['self', *given])}):\n{''.join(lines) or '    pass'}", scope)
    init: Callable[..., None] = scope["__init__"]
    init.__qualname__ = f"{cls.__qualname__}.__init__"
    return init


_compared: dict[type, Callable[[Any], tuple[Any, ...]]] = {}


def _compared_of(record: Any) -> Callable[[Any], tuple[Any, ...]]:
    """What gives the values by which instances of a record's class are compared."""
    cls = type(record)
    if cls not in _compared:
        names = [field.name for field in dataclasses.fields(cls) if field.compare]
        several = len(names) > 1
        _compared[cls] = attrgetter(*names) if several else lambda one: tuple(getattr(one, n) for n in names)
    return _compared[cls]


def _equal(self: Any, other: object) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = _compared_of(self)
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(_compared_of(self)(self))


def _shown(self: Any) -> str:
    shown = [f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr]
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _refuse_change(self: Any, name: str, value: object = None) -> None:
    raise FrozenInstanceError(f"cannot change {name!r} of a {type(self).__qualname__}, which is frozen")


class _Signature:
    """The signature of a class, for ``help`` and notebooks, which would otherwise find that of all
    classes.
    """

    def __get__(self, instance: object, owner: type) -> Any:
        if instance is not None:
            raise AttributeError("__signature__")
        import inspect

        whole = inspect.signature(_compiled_init(owner))
        return whole.replace(parameters=list(whole.parameters.values())[1:])
