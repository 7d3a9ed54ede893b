"""Commands: arguments, options, examples, exit status, from the command line itself."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import typer.main

from generate.pages import code, table, toctree, write
from hovercontrol.app.commands.app import app


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each command."""
    group: Any = typer.main.get_command(app)
    names = list(group.commands)
    for name in names:
        _page(name, group.commands[name], into / "commands" / f"{name}.md")
    rows = [
        (f"[`{name}`](commands/{name}.md)", (group.commands[name].help or "").partition("\n\n")[0])
        for name in names
    ]
    write(
        into / "commands.md",
        "# Commands",
        "`hovercontrol COMMAND --help` says the same on the screen; `python -m hovercontrol` is the command, too.",
        table(("command", "what it does"), rows),
        "## Of all commands",
        table(("option", "what it does"), [_option(p) for p in group.params if not p.hidden]),
        group.epilog or "",
        "`hovercontrol --install-completion bash` lets the Tab key complete commands, options and names (scenarios, craft, "
        "effects) in bash; zsh, fish, powershell and pwsh likewise. `--show-completion bash` prints the script.",
        toctree(f"commands/{name}" for name in names),
    )
    return "commands", f"{len(names)} commands"


def _page(name: str, command: Any, path: Path) -> None:
    shown = [p for p in command.params if not p.hidden]
    arguments = [p for p in shown if p.opts and not p.opts[0].startswith("-")]
    options = [p for p in shown if p.opts and p.opts[0].startswith("-")]
    usage = " ".join(_usage(p) for p in arguments)
    example = (command.epilog or "").removeprefix("Example: ")
    write(
        path,
        f"# hovercontrol {name}",
        *(" ".join(part.split()) for part in (command.help or "").split("\n\n")),
        code(f"hovercontrol {name} {usage} [OPTIONS]".replace("  ", " ")),
        f"An example:\n\n{code('$ ' + example, 'console')}" if example else "",
        "## Arguments" if arguments else "",
        table(("argument", "what it is"), [(f"`{p.metavar or p.name}`", _plain(p)) for p in arguments]),
        "## Options",
        table(("option", "what it does"), [_option(p) for p in options]),
    )


def _plain(p: Any) -> str:
    """Return an option's help, which is plain text, as Markdown."""
    return re.sub(r"([\[\]*<])", r"\\\1", p.help or "")


def _usage(p: Any) -> str:
    called = p.metavar or p.name.upper()
    return called if p.required else f"[{called}]"


def _option(p: Any) -> tuple[str, str]:
    names = ", ".join(f"`{o}`" for o in (*p.opts, *p.secondary_opts))
    value = "" if getattr(p, "is_flag", False) else f" {p.metavar or ''}".rstrip()
    default = p.default
    told = default not in (None, "", False, ()) and not callable(default) and not isinstance(default, list)
    text = _plain(p) + (f" Default: {default}." if told else "")
    return names + value, text
