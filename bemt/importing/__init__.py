"""Command ``import``: files of any format as one record, averaged, checked and reduced (`command` joins them)."""

from bemt.importing.choice import Choice
from bemt.importing.command import document, import_file

__all__ = ["Choice", "document", "import_file"]
