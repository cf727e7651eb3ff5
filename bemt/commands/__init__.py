"""One thin file per subcommand: parse, call, print, exit code.

A file defines ``NAME``, ``HELP`` (one line), ``GROUP``, ``EXAMPLE`` (a whole command line), ``arguments(parser)`` and
``run(args)``, which returns the exit code. At its top it imports the standard library only, so that ``--help`` answers
at once; everything else is imported in ``run``. `bemt.commands.cli` finds it by scanning this folder.
"""
