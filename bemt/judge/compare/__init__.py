"""What changed between two recordings, and one run beside the model.

``bemt.compare(a, b)`` says what changed between two recordings: ``help(bemt.app.library.compare)``.
"""
