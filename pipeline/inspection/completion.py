"""Completion of commands, options and names in bash, zsh and fish, made from the parser."""

from __future__ import annotations

import argparse

from pipeline.config.layers import STUDIES, TABLES, known

BASH = """_vsr() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} all=
  case "$before" in
{values}
  esac
  if [ -z "$all" ]; then
    case "${{COMP_WORDS[1]}}" in
{commands}
      *) all="{verbs}" ;;
    esac
    [ "$COMP_CWORD" = 1 ] && all="{verbs}"
  fi
  COMPREPLY=($(compgen -W "$all" -- "$word"))
}}
complete -o default -F _vsr vsr
"""


def script(shell: str, parser: argparse.ArgumentParser) -> str:
    """What a shell is to read."""
    (verbs,) = [one for one in parser._actions if isinstance(one, argparse._SubParsersAction)]
    values = {"--site": known(), "--study": known(STUDIES), "--table": known(TABLES)}
    if shell == "fish":
        return _fish(verbs.choices, values)
    commands = "\n".join(
        f'      {verb}) all="{" ".join(_words(sub))}" ;;' for verb, sub in verbs.choices.items()
    )
    cases = "\n".join(f'    {option}) all="{" ".join(of)}" ;;' for option, of in values.items())
    text = BASH.format(values=cases, commands=commands, verbs=" ".join(verbs.choices))
    return ("autoload -U +X bashcompinit && bashcompinit\n" if shell == "zsh" else "") + text


def _words(sub: argparse.ArgumentParser) -> list[str]:
    """Options of a command, and names that stand without one, such as products."""
    words = [one for action in sub._actions for one in action.option_strings if one[:2] == "--"]
    plain = [one.choices for one in sub._actions if not one.option_strings and one.choices]
    return words + [str(name) for choices in plain for name in choices]


def _fish(verbs: dict[str, argparse.ArgumentParser], values: dict[str, list[str]]) -> str:
    lines = [f'complete -c vsr -f -n __fish_use_subcommand -a "{" ".join(verbs)}"']
    for verb, sub in verbs.items():
        at = f'complete -c vsr -n "__fish_seen_subcommand_from {verb}"'
        for word in _words(sub):
            names = f' -x -a "{" ".join(values[word])}"' if word in values else ""
            lines.append(f"{at} -l {word[2:]}{names}" if word[:2] == "--" else f"{at} -a {word}")
    return "\n".join(lines) + "\n"
