"""What the Tab key offers after `--hide`, also in bash, which breaks words at `:` and `=`.

`effect_words` offers effects, then keys of the effect that stands there; zsh and fish show what each means. Importing
this module teaches click our `Bash`.
"""

import os
from typing import Any, ClassVar

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class, split_arg_string

SOURCE = """\
%(complete_func)s() {
    local IFS=$'\\n' each type value answer
    local line="${COMP_LINE:0:$COMP_POINT}"
    answer=$(env COMP_LINE="$line" COMP_WORDBREAKS="$COMP_WORDBREAKS" %(complete_var)s=bash_complete $1)
    for each in $answer; do
        IFS=',' read type value <<< "$each"
        case $type in
            dir) COMPREPLY=(); compopt -o dirnames ;;
            file) COMPREPLY=(); compopt -o default ;;
            plain) COMPREPLY+=("$value"); [[ $value == *[=:] ]] && compopt -o nospace ;;
        esac
    done
    return 0
}
complete -o nosort -F %(complete_func)s %(prog_name)s
"""


class Bash(BashComplete):
    """Reads the whole line, and answers from the last place on at which bash breaks words."""

    source_template: ClassVar[str] = SOURCE

    def get_completion_args(self) -> tuple[list[str], str]:
        """The words before the present one without the program's name, and what is there of the present one."""
        line = os.environ.get("COMP_LINE")
        if line is None:  # a start file that was written for click's own
            return super().get_completion_args()
        words = split_arg_string(line)
        incomplete = words.pop() if words and not line[-1].isspace() else ""
        return words[1:], incomplete

    def format_completion(self, item: CompletionItem[Any]) -> str:
        """As click does, without what stands before the last break."""
        breaks = set(os.environ.get("COMP_WORDBREAKS", "")) & set(":=")
        _, incomplete = self.get_completion_args()
        written = 1 + max((incomplete.rfind(mark) for mark in breaks), default=-1)
        return f"{item.type},{item.value[written:] if item.type == 'plain' else item.value}"


def effect_words(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem[Any]]:
    """Effects that can be hidden; behind `EFFECT:` its keys that are not given yet. Nothing for an unknown effect."""
    from fidim_lab.app.compose import hidden_keys

    known = hidden_keys()
    effect, colon, given = incomplete.partition(":")
    if not colon:
        return [CompletionItem(name + end) for name in known if name.startswith(effect) for end in ("", ":")]
    *before, begun = given.split(",")
    taken = {pair.partition("=")[0] for pair in before}
    begin = incomplete.removesuffix(begun)
    return [
        CompletionItem(f"{begin}{key}=", help=says)
        for key, says in known.get(effect, {}).items()
        if key.startswith(begun) and key not in taken
    ]


def hide_option(says: str) -> Any:
    """The option `--hide`, the same for all commands that have a simulated world."""
    metavar = "EFFECT[:key=value,…]"
    return click.option("--hide", multiple=True, metavar=metavar, help=says, shell_complete=effect_words)


add_completion_class(Bash, "bash")
