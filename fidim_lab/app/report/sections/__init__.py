"""Parts of a page: tables of text cells, sentences, one section for each window, what was left out.

In: contents and results. Out: rows, texts and drawings, rounded for a reader.
"""
