"""A command that refuses repeated options: otherwise the last value would be used silently."""

from __future__ import annotations

from collections import Counter
from typing import Any

from typer.core import TyperCommand, TyperOption

from hovercontrol.base.errors import InputError


class OnceCommand(TyperCommand):
    """A command that refuses an option with a value given twice, unless the option is a list."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line.

        Raises
        ------
        InputError
            If an option is given twice.
        """
        if ctx.resilient_parsing:  # shell completion: the last word is incomplete
            return super().parse_args(ctx, args)
        given = self.make_parser(ctx).parse_args(args=list(args))[2]
        single = [p for p in given if isinstance(p, TyperOption) and not (p.multiple or p.is_flag)]
        for option, times in Counter(single).items():
            if times > 1:
                raise InputError(f"{ctx.info_name}: {option.opts[0]} is given {times} times, expected once")
        return super().parse_args(ctx, args)
