"""Dataset: the one currency in which BEMT, K1/K2, CFD, bench and vendor numbers meet (`dataset.points`)."""

from bemt.physics.dataset.channels import DIMENSIONLESS, KINDS, ORIGINS
from bemt.physics.dataset.make import concat, from_pandas
from bemt.physics.dataset.points import Dataset

__all__ = ["DIMENSIONLESS", "KINDS", "ORIGINS", "Dataset", "concat", "from_pandas"]
