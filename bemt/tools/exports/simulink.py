"""Simulink: breakpoints and tables for n-D lookup blocks in a MAT file."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.hub import hub_document, hub_loads
from bemt.tools.exports.parts import plain_name, still_hub, table_document, table_of_document


class SimulinkExport(LoadsExport):
    """MAT file, version 5."""

    id = "simulink"
    title = "Simulink lookup tables (.mat)"
    holds = (
        "tables CT(rpm, J), CP(rpm, J) and of the hub over rpm, J along and across the shaft, linear, held at the ends"
    )
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "duct", "rotation", "hub"})
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
        doc["hub"] = {k: np.asarray(v, dtype=float) for k, v in hub_document(job.hub or still_hub()).items()}
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
        return table_of_document(_document(files), rpm, airspeed_m_s)

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """The file read back, linear in each axis."""
        doc = _document(files)
        rho, D = float(doc["density_kg_m3"]), float(doc["diameter_m"])
        found = hub_loads(doc["hub"], rho, D, rpm, airspeed_m_s, side_m_s)
        found[:2] += table_of_document(doc, rpm, airspeed_m_s)
        return found


def _document(files: Files) -> dict[str, Any]:
    from scipy.io import loadmat

    data = next(iter(files.values()))
    assert isinstance(data, bytes)
    found = loadmat(io.BytesIO(data), squeeze_me=True, simplify_cells=True)
    doc: dict[str, Any] = next(v for k, v in found.items() if not k.startswith("__"))
    return doc
