"""The two doors: the command line and the public API of `import bemt`."""
