"""Command ``import``: files of any format as one record, averaged, checked and reduced (`command` joins them)."""

from bemt.recordings.choice import Choice
from bemt.recordings.load import document, import_file

__all__ = ["Choice", "document", "import_file"]
