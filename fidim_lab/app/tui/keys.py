"""One key for each choice of a prompt, never one that commands something else."""

import string
from collections.abc import Sequence

RESERVED = "tgrpkoxqie"
"""letters that command, on every screen (see `app`)"""
SETTLE = 0.3
"""s for which a new prompt takes no key: one that was pressed for what was there before answers nothing"""


def choice_keys(choices: Sequence[str]) -> dict[str, str]:
    """Key → choice: the choice's first free letter, or else any free letter."""
    taken: dict[str, str] = {}
    for choice in choices:
        letters = [*choice.lower(), *string.ascii_lowercase]
        free = (c for c in letters if c in string.ascii_lowercase and c not in RESERVED and c not in taken)
        key = next(free, None)
        if key is not None:
            taken[key] = choice
    return taken
