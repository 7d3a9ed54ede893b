"""Shell completion, generated from the commands themselves: ``hovercontrol --completion bash``.

The scripts are text alone: no Python starts at a press of the key.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hovercontrol.errors import InputError, did_you_mean


@dataclass(frozen=True)
class Word:
    """An option or an argument of a command.

    Parameters
    ----------
    names : tuple of str
        ``--out``, ``-o``; empty for an argument.
    help : str
        One line.
    takes_value : bool
    values : tuple of str
        What it can be, where that is known; files otherwise.
    """

    names: tuple[str, ...]
    help: str
    takes_value: bool
    values: tuple[str, ...]


@dataclass(frozen=True)
class Command:
    """A command: its name, one line of help, options and arguments."""

    name: str
    help: str
    options: tuple[Word, ...]
    arguments: tuple[Word, ...]


def script(shell: str, root: Any) -> str:
    """Return the completion script of a shell.

    Parameters
    ----------
    shell : {"bash", "zsh", "fish"}
    root : click.Group
        The command line.

    Raises
    ------
    InputError
        If the shell is not known.
    """
    makers: dict[str, Callable[[Sequence[Command], Sequence[Word]], str]] = {
        "bash": _bash,
        "zsh": _zsh,
        "fish": _fish,
    }
    if shell not in makers:
        raise InputError(f"--completion: unknown shell {shell!r}{did_you_mean(shell, makers)}")
    values = _values()
    commands = [_command(name, c, values) for name, c in sorted(root.commands.items()) if not c.hidden]
    general = [_word("", p, values) for p in root.params if p.param_type_name == "option"]
    return makers[shell](commands, [*general, Word(("--help", "-h"), "Show the help.", False, ())])


def _command(name: str, found: Any, values: dict[str, tuple[str, ...]]) -> Command:
    shown = [p for p in found.params if not getattr(p, "hidden", False)]
    options = [_word(name, p, values) for p in shown if p.param_type_name == "option"]
    arguments = [_word(name, p, values) for p in shown if p.param_type_name == "argument"]
    options.append(Word(("--help", "-h"), "Show the help.", False, ()))
    line = (found.help or "").strip().split("\n")[0]
    return Command(name, line, tuple(options), tuple(arguments))


def _word(command: str, parameter: Any, values: dict[str, tuple[str, ...]]) -> Word:
    option = parameter.param_type_name == "option"
    names = tuple([*parameter.opts, *parameter.secondary_opts]) if option else ()
    key = next((k for k in (f"{command} {parameter.name}", parameter.name) if k in values), None)
    text = " ".join((getattr(parameter, "help", None) or parameter.name).split())
    return Word(names, text, not getattr(parameter, "is_flag", False), values[key] if key else ())


def _values() -> dict[str, tuple[str, ...]]:
    """Return what parameters can be, by name or by command and name."""
    from hovercontrol.commands.analyze import known_scripts
    from hovercontrol.effects import effect_names
    from hovercontrol.fmi.exporter.binaries import PLATFORMS
    from hovercontrol.models.template import KINDS
    from hovercontrol.models.vehicles import VEHICLES
    from hovercontrol.scenarios import scenario_names
    from hovercontrol.schema import KINDS as SCHEMAS
    from hovercontrol.targets.sweep import FIGURES

    return {
        "vehicle": tuple(VEHICLES),
        "scenario": tuple(scenario_names()),
        "export block": (*scenario_names(), *VEHICLES),
        "analyze name": tuple(known_scripts()),
        "new kind": KINDS,
        "sweep figure": FIGURES,
        "effects": tuple(effect_names()),
        "friction": ("events", "smooth"),
        "fmi": ("2", "3"),
        "platforms": (*PLATFORMS, "all"),
        "completion": ("bash", "zsh", "fish"),
        "schema kind": tuple(SCHEMAS),
    }


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def _bash(commands: Sequence[Command], general: Sequence[Word]) -> str:
    lines = [
        '# bash completion of hovercontrol. In ~/.bashrc: eval "$(hovercontrol --completion bash)"',
        "_hovercontrol() {",
        '    local current="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}"',
        '    local command="" word words=""',
        '    for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do',
        f'        case "$word" in {"|".join(c.name for c in commands)}) command="$word"; break;; esac',
        "    done",
        '    case "$command $before" in',
    ]
    for command, words in (("", general), *((c.name, c.options) for c in commands)):
        for w in words:
            if w.takes_value:
                at = "|".join(f'"{command} {name}"' for name in w.names)
                lines.append(f"        {at}) words={_quoted(' '.join(w.values))} ;;")
    lines += ["        *)", '            case "$command" in']
    names = " ".join([*(c.name for c in commands), *(n for w in general for n in w.names)])
    lines.append(f'                "") words={_quoted(names)} ;;')
    for c in commands:
        options = " ".join(n for w in c.options for n in w.names)
        values = " ".join(v for w in c.arguments for v in w.values)
        lines += [
            f'                {c.name}) if [[ "$current" == -* ]]; then words={_quoted(options)}; '
            f"else words={_quoted(values)}; fi ;;"
        ]
    lines += [
        "            esac ;;",
        "    esac",
        '    COMPREPLY=($(compgen -W "$words" -- "$current"))',
        "}",
        "complete -o bashdefault -o default -F _hovercontrol hovercontrol",
    ]
    return "\n".join(lines) + "\n"


def _zsh(commands: Sequence[Command], general: Sequence[Word]) -> str:
    lines = [
        "#compdef hovercontrol",
        "# zsh completion of hovercontrol. In ~/.zshrc, after compinit:",
        "# source <(hovercontrol --completion zsh)",
        "_hovercontrol() {",
        "    local -a commands",
        "    commands=(",
        *(f"        {_quoted(c.name + ':' + c.help.replace(':', ' -'))}" for c in commands),
        "    )",
        "    if (( CURRENT == 2 )); then",
        "        _describe command commands",
        "        _arguments " + " ".join(s for w in general for s in _zsh_specs(w)),
        "        return",
        "    fi",
        "    local command=$words[2]",
        "    shift words; (( CURRENT-- ))",
        "    case $command in",
    ]
    for c in commands:
        specs = [s for w in c.options for s in _zsh_specs(w)]
        specs += [_quoted(f"*:{_zsh_text(w.help)[:40]}:{_zsh_action(w)}") for w in c.arguments[:1]]
        lines.append(f"        {c.name})\n            _arguments \\")
        lines += [" \\\n".join(f"                {s}" for s in specs), "            ;;"]
    lines += ["    esac", "}", 'if [ "$funcstack[1]" = _hovercontrol ]; then _hovercontrol "$@"']
    lines += ["else compdef _hovercontrol hovercontrol; fi"]
    return "\n".join(lines) + "\n"


def _zsh_specs(w: Word) -> list[str]:
    value = f":value:{_zsh_action(w)}" if w.takes_value else ""
    return [_quoted(f"{name}[{_zsh_text(w.help)}]{value}") for name in w.names]


def _zsh_action(w: Word) -> str:
    known = " ".join(w.values)
    if w.names and known:
        return f"({known})"
    return f"{{compadd -- {known}; _files}}" if known else "_files"  # an argument may be a file as well


def _zsh_text(text: str) -> str:
    for sign in "[]":
        text = text.replace(sign, f"\\{sign}")
    return text.replace(":", " -")


def _fish(commands: Sequence[Command], general: Sequence[Word]) -> str:
    lines = ["# fish completion of hovercontrol: hovercontrol --completion fish | source"]
    lines += [_fish_line("__fish_use_subcommand", w) for w in general]
    for c in commands:
        lines.append(
            f"complete -c hovercontrol -f -n __fish_use_subcommand -a {c.name} -d {_fish_text(c.help)}"
        )
    for c in commands:
        inside = _fish_text(f"__fish_seen_subcommand_from {c.name}")
        lines += [_fish_line(inside, w) for w in c.options]
        for w in c.arguments:
            if w.values:
                lines.append(f"complete -c hovercontrol -n {inside} -a {_fish_text(' '.join(w.values))}")
    return "\n".join(lines) + "\n"


def _fish_line(condition: str, w: Word) -> str:
    names = " ".join(f"-l {n[2:]}" if n.startswith("--") else f"-s {n[1:]}" for n in w.names)
    value = ""
    if w.takes_value:
        value = f" -x -a {_fish_text(' '.join(w.values))}" if w.values else " -r"
    return f"complete -c hovercontrol -n {condition} {names}{value} -d {_fish_text(w.help)}"


def _fish_text(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
