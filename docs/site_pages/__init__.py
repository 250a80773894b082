"""Pages of the site that are generated from the code.

Each module returns the text of one kind of page. `pages.py` lists them all, and `extension.py`
hands them to Sphinx.
"""
