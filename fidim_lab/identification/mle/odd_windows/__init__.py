"""Windows, or parts of them, that one body in free motion does not explain.

`odd_window`: one whose body or forces are others; `touched`: ends that a hand still, or already, touched; `changed`:
all from some time of the session on.
"""
