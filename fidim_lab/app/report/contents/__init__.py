"""What a folder holds, as a report tells it: its files, its journal, its explanation, and the proof of that.

In: a run, campaign or import folder. Out: frozen values; FileError for what is missing or wrong.
"""
