"""Dataset: the one currency in which BEMT, K1/K2, CFD, bench and vendor numbers meet (:mod:`bemt.dataset.points`)."""

from bemt.dataset.points import DIMENSIONLESS, KINDS, ORIGINS, Dataset, concat
from bemt.dataset.tables import from_pandas

__all__ = ["DIMENSIONLESS", "KINDS", "ORIGINS", "Dataset", "concat", "from_pandas"]
