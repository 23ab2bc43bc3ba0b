"""Two themes. Good, doubtful and bad are blue, orange and vermillion (Okabe and Ito), and always have a symbol too."""

from textual.theme import Theme

DARK = Theme(
    name="fidim-dark",
    primary="#56B4E9",
    secondary="#009E73",
    accent="#E69F00",
    foreground="#e6e6e6",
    background="#101418",
    surface="#101418",
    panel="#1d242b",
    dark=True,
    variables={
        "good": "#56B4E9",
        "doubtful": "#E69F00",
        "wrong": "#ff7f50",
        "old": "#77808a",
        "faint": "#98a2ad",
        "alarm": "#ffffff",
        "alarm-ground": "#b02a00",
        "rig": "#101418",
        "rig-ground": "#e6e6e6",
        "measured": "#56B4E9",
        "model": "#E69F00",
    },
)
LIGHT = Theme(
    name="fidim-light",
    primary="#005a8c",
    secondary="#00664b",
    accent="#8a5a00",
    foreground="#14181c",
    background="#ffffff",
    surface="#ffffff",
    panel="#e6eaee",
    dark=False,
    variables={
        "good": "#005a8c",
        "doubtful": "#8a5a00",
        "wrong": "#a83200",
        "old": "#8a9199",
        "faint": "#5a636c",
        "alarm": "#ffffff",
        "alarm-ground": "#a83200",
        "rig": "#ffffff",
        "rig-ground": "#14181c",
        "measured": "#005a8c",
        "model": "#a35f00",
    },
)
