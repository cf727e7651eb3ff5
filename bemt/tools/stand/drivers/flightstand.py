"""Tyto Flight Stand: the official client ``flightstand`` 3 (gRPC), the program of the stand runs beside.

The core triggers its own cut-off when its clients are gone; how soon is the core's own matter.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import math
from typing import Any

from bemt.base.errors import needs
from bemt.base.units import RPM
from bemt.tools.stand import drivers
from bemt.tools.stand.drivers import parts, silent

ROWS = "samples of the Flight Stand program"
INPUTS = {
    "thrust_N": ("FORCE_FZ", 1.0), "torque_Nm": ("TORQUE_MZ", 1.0), "rpm": ("ROTATION_SPEED_FREQUENCY", 1.0 / RPM),
    "current_A": ("CURRENT_HALL_CURRENT", 1.0), "voltage_V": ("VOLTAGE_HV_INPUT", 1.0),
    "vibration_m_s2": ("ACCELEROMETER_VIBRATION_LEVEL", 1.0), "airspeed_m_s": ("AIRSPEED_DIFFERENTIAL_PRESSURE", 1.0),
}  # fmt: skip
"""Their type of an input and its factor to our channel. The airspeed is taken to be in m/s (SI, as they say of all)."""


class _Core:
    def __init__(self, core: Any, lost: type[Exception]) -> None:
        self.core, self.lost, kind = core, lost, core.Proto
        self.mask = needs("google.protobuf.field_mask_pb2", "stand").FieldMask(paths=["output_target"])
        self.esc = core.find_output_by_type(kind.ESC)
        found = ((core.find_input_by_type(getattr(kind, type_)), ours, f) for ours, (type_, f) in INPUTS.items())
        self.signals = {i.signal_name: (ours, f) for i, ours, f in found if i is not None}

    def _call(self, method: str, request: Any, failure: str) -> Any:
        try:
            return getattr(self.core.stub, method)(request, timeout=drivers.PATIENCE_S)
        except self.lost as error:
            raise OSError(f"the core {failure}: {error.details()}") from error  # type: ignore[attr-defined]

    def write(self, pulse_us: float) -> None:
        self.esc.output_target.active, self.esc.output_target.target_value = True, pulse_us
        request = self.core.Proto.UpdateOutputRequest(output=self.esc, mask=self.mask)
        self._call("UpdateOutput", request, "did not take the command")

    def read(self) -> dict[str, float]:
        told = self._call("ListSamples", self.core.Proto.ListSamplesRequest(), "sent no samples")
        row, stamp = {}, 0.0
        for sample in told.sample_group.samples:
            if sample.signal_name in self.signals:
                name, factor = self.signals[sample.signal_name]
                row[name] = sample.value * factor if sample.active else math.nan
                stamp = max(stamp, sample.sample_time.ToNanoseconds() * 1e-9)
        return {**row, "stamp_s": stamp}

    def close(self) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            self.core.cleanup()  # triggers the cut-off


def connect(address: str, line: str) -> _Core:
    """Open the core at host:port; a cut-off that is there is cleared."""
    parts(address, r"\S+:\d+", "host:port, such as localhost:50051")
    client, grpc = needs("FlightStand", "stand"), needs("grpc", "stand")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            core = client.FlightStand(address, heartbeat=True)
    except SystemExit:  # the client's own way to say it
        raise silent(address, "the Flight Stand program") from None
    atexit.unregister(core.cleanup)  # the guard closes
    if core.find_output_by_type(core.Proto.ESC) is None:
        core.cleanup()
        raise silent(address, "a stand with an ESC output")
    return _Core(core, grpc.RpcError)
