"""Gaussian models: whitening, covariance kernels, evidence of linear terms, mixtures, restricted likelihood.

Knows no rotor. What readings may scatter by, and what a cause would change, is for those who call: rotors, judge,
comparison of recordings, and the proof.
"""
