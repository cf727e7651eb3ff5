"""A stand that answers: three verbs behind a guard, and the loop from a recording to the run that decides."""
