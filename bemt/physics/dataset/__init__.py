"""Dataset: the one currency in which BEMT, K1/K2, CFD, bench and vendor numbers meet (:mod:`bemt.dataset.points`)."""

from bemt.dataset.channels import DIMENSIONLESS, KINDS, ORIGINS
from bemt.dataset.make import concat, from_pandas
from bemt.dataset.points import Dataset

__all__ = ["DIMENSIONLESS", "KINDS", "ORIGINS", "Dataset", "concat", "from_pandas"]
