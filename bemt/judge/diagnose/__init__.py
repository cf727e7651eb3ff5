"""What physics was left out: from recording and case to a named effect, a class of them, or an honest "cannot tell".

The way of the data: ``record`` (points and covariates) -> ``problem`` (baseline, ``nuisance``, ``noise``) ->
``signatures`` (every effect solved over its ranges) -> ``posterior`` (none, each effect, pairs, an unknown smooth
effect; with ``knowledge`` and ``form``) -> :mod:`bemt.judge.loss` (what is said) -> ``fit`` (parameters), ``answer``,
``suggest`` -> ``document`` (``bemt.diagnosis/1``), text, figures.

``bemt.diagnose(recordings, case)`` goes all the way.
"""
