"""The HTML report of a run or campaign: one file that opens offline.

`report` gathers what a folder holds, `figures` draws it as SVG, `page.html.jinja` sets it.
"""
