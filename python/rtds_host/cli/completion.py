"""`rtds completion`: what a shell needs to complete commands, options, scenarios and effects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import typer

app = typer.Typer(add_completion=False)
SHELLS = ("bash", "zsh", "fish")


@dataclass(frozen=True)
class Known:
    """A command: its options with the words that may follow them (None: nothing follows; (): a file or free text), the
    words that may stand by themselves, and its sub-commands."""

    about: str
    options: dict[str, tuple[str, ...] | None] = field(default_factory=dict)
    words: tuple[str, ...] = ()
    commands: dict[str, Known] = field(default_factory=dict)


def _choices() -> tuple[dict[str, tuple[str, ...]], dict[str, tuple[str, ...]]]:
    """Words after an option, and words a command takes by themselves."""
    from rtds_host.cli.close import LINKS as CLOSE_LINKS
    from rtds_host.control import CONTROLLERS
    from rtds_host.diagnosis.effects import CATALOGUE
    from rtds_host.export.table import TARGETS
    from rtds_host.importers import builtin_mappings
    from rtds_host.plan.make import KINDS
    from rtds_host.robot import ENGINES
    from rtds_host.run import COUPLINGS
    from rtds_host.scenario import scenarios

    names = tuple(scenarios())
    after = {
        "--to": TARGETS,
        "--as": KINDS,
        "--engine": ENGINES,
        "--against": ENGINES,
        "--controller": tuple(CONTROLLERS),
        "--coupling": COUPLINGS,
        "--mapping": tuple(builtin_mappings()),
        "--sim": ("verilator", "icarus"),
        "--format": ("csv", "parquet"),
        "--link": ("rtl", "model", "chip", "ad2"),
        "close --link": CLOSE_LINKS,
        "plan --scenario": names,
        "--effect": tuple(f"{effect.id}.{effect.parameters[0].name}=" for effect in CATALOGUE.values()),
        "--support": ("skids", "caster"),
        "--method": ("backward_euler", "trapezoidal"),
        "--world": ("planar", "mujoco"),
    }
    return after, {"run": (*names, "all"), "effects": tuple(sorted(CATALOGUE)), "completion": SHELLS}


def known_commands() -> dict[str, Known]:
    """All commands of the program, as they describe themselves."""
    import importlib

    import typer.main

    from rtds_host.cli.commands import COMMANDS, MODULES

    after, alone = _choices()

    def look(name: str, command, about: str) -> Known:
        options: dict[str, tuple[str, ...] | None] = {"--help": None}
        for parameter in command.params:
            for option in (*parameter.opts, *parameter.secondary_opts):
                if option.startswith("--"):
                    taken = after.get(f"{name} {option}", after.get(option, ()))
                    options[option] = None if parameter.is_flag else taken
        children = {
            child: look(f"{name} {child}", one, (one.help or "").split("\n")[0])
            for child, one in getattr(command, "commands", {}).items()
        }
        return Known(about, options, alone.get(name, ()), children)

    return {
        name: look(
            name, typer.main.get_command(importlib.import_module(f"rtds_host.cli.{MODULES.get(name, name)}").app), about
        )
        for name, about in COMMANDS.items()
    }


def _bash(commands: dict[str, Known]) -> str:
    cases = []

    def case(path: str, one: Known) -> None:
        following = "".join(
            f'      {option}) words="{" ".join(words)}";;\n'
            for option, words in one.options.items()
            if words is not None
        )
        cases.append(
            f'  "{path}")\n    options="{" ".join(one.options)}"\n    alone="{" ".join((*one.commands, *one.words))}"\n'
            f'    case "$before" in\n{following}      *) values=no;;\n    esac;;\n'
        )
        for name, child in one.commands.items():
            case(f"{path} {name}", child)

    for name, one in commands.items():
        case(name, one)
    groups = "|".join(name for name, one in commands.items() if one.commands)
    return f"""_rtds() {{
  local cur="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" path="" words="" options=""
  local alone="" values=yes k
  for ((k = 1; k < COMP_CWORD; k++)); do
    case "${{COMP_WORDS[k]}}" in
      -*) ;;
      *)
        if [[ -z $path ]]; then path="${{COMP_WORDS[k]}}"
        elif [[ $path =~ ^({groups})$ ]]; then
          path="$path ${{COMP_WORDS[k]}}"
        else break; fi;;
    esac
  done
  case "$path" in
  "") options="--help --version"; alone="{" ".join(commands)}"; values=no;;
{"".join(cases)}  *) return;;
  esac
  if [[ $values == yes ]]; then
    COMPREPLY=($(compgen -W "$words" -- "$cur"))
    [[ ${{#COMPREPLY[@]}} == 1 && ${{COMPREPLY[0]}} == *= ]] && compopt -o nospace 2>/dev/null
  elif [[ $cur == -* ]]; then COMPREPLY=($(compgen -W "$options" -- "$cur"))
  else COMPREPLY=($(compgen -W "$alone" -- "$cur"))
  fi
}}
complete -o default -F _rtds rtds
"""


def _fish(commands: dict[str, Known]) -> str:
    def quoted(text: str) -> str:
        return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"

    lines = [
        "complete -c rtds -f -n __fish_use_subcommand -l help",
        "complete -c rtds -f -n __fish_use_subcommand -l version",
    ]
    for name, one in commands.items():
        lines.append(f"complete -c rtds -f -n __fish_use_subcommand -a {name} -d {quoted(one.about)}")
        here = quoted(f"__fish_seen_subcommand_from {name}")
        alone = (*one.commands, *one.words)
        if alone:
            lines.append(f"complete -c rtds -n {here} -a {quoted(' '.join(alone))}")
        every = dict(one.options)
        for child in one.commands.values():
            every |= child.options
        for option, words in every.items():
            takes = "" if words is None else (f" -x -a {quoted(' '.join(words))}" if words else " -r")
            lines.append(f"complete -c rtds -n {here} -l {option.removeprefix('--')}{takes}")
    return "\n".join(lines) + "\n"


def script(shell: str) -> str:
    """The completion of one shell."""
    commands = known_commands()
    if shell == "fish":
        return _fish(commands)
    return ("autoload -U +X bashcompinit && bashcompinit\n" if shell == "zsh" else "") + _bash(commands)


@app.command()
def completion(
    shell: Annotated[str, typer.Argument(help="bash, zsh or fish.")],
) -> None:
    """Print a script with which a shell completes commands, options, scenarios and effects.

    bash: rtds completion bash > ~/.local/share/bash-completion/completions/rtds
    zsh: eval "$(rtds completion zsh)" in ~/.zshrc, after compinit
    fish: rtds completion fish > ~/.config/fish/completions/rtds.fish
    """
    from rtds_host.errors import InputError, did_you_mean

    if shell not in SHELLS:
        raise InputError(f"shell {shell!r}: unknown (known: {', '.join(SHELLS)}){did_you_mean(shell, SHELLS)}")
    print(script(shell), end="")
