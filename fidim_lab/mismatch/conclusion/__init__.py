"""From the end of the search to a verdict, and from the verdict to an Explanation in values and words.

In: a Selection (`verdict.judge`). Out: an Explanation (`message.tell`), and its file.
"""
