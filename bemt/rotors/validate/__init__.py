"""BEMT against folders of measured propellers.

``bemt.validate(folder)`` runs it: ``help(bemt.app.library.validate)``.
"""
