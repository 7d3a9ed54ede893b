"""Import JAX where it is needed."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

from hovercontrol.base.errors import InputError

Run = Callable[..., dict[str, Any]]


def need_jax() -> ModuleType:
    """Import JAX, set it to double precision, and return ``jax.numpy``.

    Raises
    ------
    InputError
        If JAX is not installed.
    """
    try:
        import jax
        import jax.numpy
    except ImportError:
        raise InputError('a Block in JAX needs JAX: pip install ".[jax]"') from None
    jax.config.update("jax_enable_x64", True)
    return jax.numpy
