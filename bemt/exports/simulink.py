"""Simulink: breakpoints and tables for n-D lookup blocks in a MAT file."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.exports.base import Files, Job, LoadsExport
from bemt.exports.parts import plain_name, table_document, table_of_document

Array = NDArray[np.float64]


class SimulinkExport(LoadsExport):
    """MAT file, version 5."""

    id = "simulink"
    title = "Simulink lookup tables (.mat)"
    holds = "tables CT(rpm, J), CP(rpm, J), linear, held at the ends"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "duct", "rotation"})
    source = "MATLAB documentation: n-D Lookup Table, interpolation linear, extrapolation clip"

    def write(self, job: Job) -> Files:
        """One struct of the case's name, and its units."""
        from scipy.io import savemat

        doc: dict[str, Any] = {
            k: np.asarray(v, dtype=float) if isinstance(v, (list, float, int)) else v
            for k, v in table_document(job).items()
        }
        band = job.band
        doc |= {
            "units": "rpm rev/min, J V/(n D), CT T/(rho n^2 D^4), CP P/(rho n^3 D^5), SI otherwise",
            "u_thrust_rel": np.array(band.thrust),
            "u_torque_rel": np.array(band.torque),
        }
        stream = io.BytesIO()
        savemat(stream, {plain_name(job.case.name): doc}, oned_as="row")
        data = stream.getvalue()
        # the head states the time of writing: two runs would differ
        return {
            f"{plain_name(job.case.name)}.mat": f"MATLAB 5.0 MAT-file, bemt: {job.case.name}".ljust(116)[:116].encode()
            + data[116:]
        }

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The file read back, bilinear."""
        from scipy.io import loadmat

        data = next(iter(files.values()))
        assert isinstance(data, bytes)
        found = loadmat(io.BytesIO(data), squeeze_me=True, simplify_cells=True)
        doc = next(v for k, v in found.items() if not k.startswith("__"))
        return table_of_document(doc, rpm, airspeed_m_s)
