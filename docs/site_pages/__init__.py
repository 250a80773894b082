"""Pages of the site that are made from the code: they are written nowhere by hand.

Each module here returns the text of one kind of page; `pages.py` has them all, `extension.py` hands
them to Sphinx.
"""
