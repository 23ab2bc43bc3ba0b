"""`fidim reproduce`: the paper's experiment simulated, and its Eq. 46, 47, 49 and Fig. 3 beside ours.

Start at `command`; `tables` and `words` show what was found, `file` writes it.
"""
