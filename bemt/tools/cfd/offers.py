"""What this tool offers to the house (:mod:`bemt.base.plugins`)."""
