"""One thin file per subcommand: parse, call, print, exit code.

A file defines ``NAME``, ``HELP`` (one line), ``GROUP``, ``EXAMPLE`` (a whole command line), ``arguments(parser)`` and
``run(args)``, which returns the exit code. At the top it imports only the standard library, so that ``--help`` answers
at once; ``run`` imports everything else. `bemt.app.commands.cli` finds it by scanning this folder.
"""
