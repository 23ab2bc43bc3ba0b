"""Whole pages: report, comparison, explanation, joint fit; one HTML file that opens offline.

In: a folder, what was found in it. Out: the path of the file (`write.write_report` is the door).
"""
