"""`fidim benchmark`: proofs that anybody can run again. Here: `explain` on sealed campaigns.

    cases (what is hidden) + robots (in which robot) → seal → attempts (explain, blind) → loudness (how much there was)
    → scoring, statistics → tally → words, page

The truth of every campaign is written, and its hash printed, before the first is explained; it is opened after the
last.
"""
