"""Print a shell completion script for gait: commands, options and choices.

The script contains all words, so completion does not start Python.  Other words are completed as files.  Put
it into ~/.local/share/bash-completion/completions/gait, or source it in ~/.zshrc.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator

from gait.bindings.shipped import SHIPPED
from gait.errors import UserError

JSON = False
EXAMPLES = """\
examples:
  gait completion bash
  gait completion zsh
"""
SHELLS = ("bash", "zsh")

_SCRIPT = """\
# Completion of gait {version} for bash and zsh, made by `gait completion`.
_gait_words() {{
  case "$1" in
{words}
  esac
}}
_gait_choices() {{
  case "$1" in
{choices}
  esac
}}
_gait() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" command="" found
  if (( COMP_CWORD > 1 )); then command="${{COMP_WORDS[1]}}"; fi
  if (( COMP_CWORD > 2 )) && [ -n "$(_gait_words "$command ${{COMP_WORDS[2]}}")" ]; then
    command="$command ${{COMP_WORDS[2]}}"
  fi
  found="$(_gait_choices "$command $before")"
  if [ -z "$found" ]; then
    found="$(_gait_words "$command")"
    case "$word" in -*) ;; *) if (( COMP_CWORD > 1 )); then found="$(_gait_choices "$command")"; fi ;; esac
  fi
  COMPREPLY=($(compgen -W "$found" -- "$word"))
  case "$before" in -m|--model) COMPREPLY+=($(compgen -f -- "$word")) ;; esac
  if (( COMP_CWORD > 1 )) && [ "${{#COMPREPLY[@]}}" = 0 ]; then COMPREPLY=($(compgen -f -- "$word")); fi
}}
complete -o filenames -F _gait gait
"""
_ZSH = "autoload -Uz compinit bashcompinit && compinit -u && bashcompinit\n"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    print((_ZSH if args.shell == "zsh" else "") + script(), end="")
    return 0


def script() -> str:
    """Make the script for the commands of this version."""
    from gait._version import __version__
    from gait.cli import COMMANDS, parser_of

    words = {"": ["--help", "--version", *dict.fromkeys(name.split()[0] for name in COMMANDS)]}
    choices: dict[str, list[str]] = {}
    for name in COMMANDS:
        try:
            listed = [(one, one.choices or _named(name, one)) for one in _actions(parser_of(name))]
        except (ModuleNotFoundError, UserError):  # its extra is missing, so the command cannot be used
            listed = []
        words[name] = [
            option for action, _ in listed for option in action.option_strings if option.startswith("--")
        ]
        choices[name] = [word.partition(" ")[2] for word in COMMANDS if word.startswith(f"{name} ")]
        for action, known in listed:
            if not action.option_strings:
                choices[name] += map(str, known)
            for option in action.option_strings if known else ():
                choices[f"{name} {option}"] = [str(choice) for choice in known]
    return _SCRIPT.format(version=__version__, words=_cases(words), choices=_cases(choices))


def _named(command: str, action: argparse.Action) -> tuple[str, ...]:
    """Return words that an option takes besides files or numbers."""
    if action.dest == "model":
        return SHIPPED
    return ("all",) if (command, action.dest) == ("track", "people") else ()


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """List the options and arguments that a command's help shows."""
    yield from (action for action in parser._actions if action.help != argparse.SUPPRESS)


def _cases(table: dict[str, list[str]]) -> str:
    return "\n".join(
        f"    {shlex.quote(key)}) echo {shlex.quote(' '.join(v))} ;;" for key, v in table.items() if v
    )
