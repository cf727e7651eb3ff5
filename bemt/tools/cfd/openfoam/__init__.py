"""OpenFOAM cases as text: settings in, names and contents of files out. Nothing here touches a disk.

Made for OpenFOAM 1912 (the package of Debian 12). The frame is that of :mod:`geometry.mesh`: z along the shaft towards
thrust, blade 1 on the x axis.
"""

from bemt.tools.cfd.openfoam.settings import Body, RunSweep, Settings, sector_choice
from bemt.tools.cfd.openfoam.write import case_files

__all__ = ["Body", "Settings", "RunSweep", "case_files", "sector_choice"]
