"""The simulated stand as a process of its own: ``python -m bemt.tools.stand.simulated KEY ITEM WIRE LAPSE``.

KEY is the folder of a sealed proof: what is wrong stays in this process. It answers on the wire of a real stand, so
that the driver and the guard are those of a real one: ``flightstand`` (gRPC), ``rcbenchmark`` (UDP) or ``serial`` (a
pseudo-terminal). What a person does at a stand comes as lines of JSON: set up a run, wind and wall of a row, look,
mend; and, for the tests, what breaks and how fast time runs.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent import futures
from pathlib import Path
from typing import Any

from bemt.base.errors import needs
from bemt.base.units import KGF
from bemt.judge.proof.live import Truth
from bemt.tools.stand.drivers import flightstand
from bemt.tools.stand.sealed import bench_of

_WATCH_S, _SEND_S = 0.02, 0.01


def _flightstand(truth: Truth) -> str:
    """Serve the core's calls that the client makes."""
    needs("FlightStand", "stand")
    grpc, fs, calls = (needs(m, "stand") for m in ("grpc", "flight_stand_api_v1_pb2", "flight_stand_api_v1_pb2_grpc"))
    kinds = {ours: (getattr(fs, kind), 1.0 / f) for ours, (kind, f) in flightstand.INPUTS.items()}

    class Core(calls.FlightStandServicer):  # type: ignore[name-defined,misc]
        def GetServerStatus(self, request: Any, context: Any) -> Any:
            return fs.ServerStatus()

        def ListBoards(self, request: Any, context: Any) -> Any:
            board = fs.Board(name="/boards/1", ready=True, identification={"displayName": "bemt"})
            return fs.ListBoardsResponse(boards=[board])

        def ListInputs(self, request: Any, context: Any) -> Any:
            inputs = [fs.Input(name=f"/boards/1/inputs/{k}", input_type=kinds[n][0], signal_name=n)
                      for k, n in enumerate(truth.sample())]  # fmt: skip
            return fs.ListInputsResponse(inputs=inputs)

        def ListOutputs(self, request: Any, context: Any) -> Any:
            esc = fs.Output(name="/boards/1/outputs/1", output_type=fs.ESC, min_user_value=1000, max_user_value=2001)
            return fs.ListOutputsResponse(outputs=[esc])

        def UpdateOutput(self, request: Any, context: Any) -> Any:
            if truth.cut:
                context.abort(grpc.StatusCode.FAILED_PRECONDITION, "a cut-off is active")
            truth.command(request.output.output_target.target_value)
            return request.output

        def ListSamples(self, request: Any, context: Any) -> Any:
            out, now = fs.ListSamplesResponse(), time.time_ns()
            for name, value in truth.sample().items():
                one = out.sample_group.samples.add(signal_name=name, active=True, value=value * kinds[name][1])
                one.sample_time.FromNanoseconds(now)
            return out

        def TriggerCutoff(self, request: Any, context: Any) -> Any:
            truth.cut_off()
            return fs.TriggerCutoffResponse()

        def ClearCutoff(self, request: Any, context: Any) -> Any:
            truth.cut = False
            return fs.ClearCutoffResponse()

    server = grpc.server(futures.ThreadPoolExecutor(4))
    calls.add_FlightStandServicer_to_server(Core(), server)
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    globals()["_server"] = server  # it stops when nobody holds it
    return f"127.0.0.1:{port}"


def _rcbenchmark(truth: Truth) -> str:
    """Do what ``rcbenchmark.js`` does."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        other = free.getsockname()
    here = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    here.bind(("127.0.0.1", 0))
    names = {"thrust_N": ("thrust", "kgf", 1.0 / KGF), "torque_Nm": ("torque", "N·m", 1.0),
             "current_A": ("current", "A", 1.0), "rpm": ("motorOpticalSpeed", "RPM", 1.0),
             "vibration_m_s2": ("vibration", "m/s²", 1.0), "airspeed_m_s": ("airspeed", "m/s", 1.0)}  # fmt: skip

    def tell(sample: Mapping[str, float]) -> None:
        row = ((names[n], v) for n, v in sample.items())
        told = {theirs: {"workingValue": v * f, "workingUnit": unit} for (theirs, unit, f), v in row}
        here.sendto(json.dumps(told).replace("NaN", "null").encode(), other)

    here.sendto(b"Hi from RCbenchmark script!", other)
    _talk(truth, lambda: here.recv(1000).decode(), tell)
    return f"127.0.0.1:{here.getsockname()[1]}:{other[1]}"


def _serial(truth: Truth) -> str:
    """Be a board at the end of a line: ``S1200`` sets, a row goes out as the default format says."""
    import tty

    ours, theirs = os.openpty()
    tty.setraw(theirs)
    lines = os.fdopen(os.dup(ours), "r", errors="replace")

    def tell(r: Mapping[str, float]) -> None:
        row = (1e3 * time.monotonic(), 1e3 * r["thrust_N"] / KGF, 1e3 * r["torque_Nm"], r["rpm"])
        os.write(ours, (",".join(f"{v:.7g}" for v in (*row, r["current_A"])) + "\n").encode())

    _talk(truth, lambda: lines.readline().removeprefix("S"), tell)
    return f"{os.ttyname(theirs)}@115200"


def _talk(truth: Truth, hear: Callable[[], str], tell: Callable[[Mapping[str, float]], None]) -> None:
    """Take commands, and send rows."""

    def listen() -> None:
        text = hear()
        truth.cut = False
        truth.command(float(text))

    def send() -> None:
        if truth.broken != "silent":
            tell(truth.sample())

    _forever(listen, 0.0)
    _forever(send, _SEND_S)


def _forever(do: Callable[[], None], every_s: float) -> None:
    def again() -> None:
        while True:
            do()
            time.sleep(every_s)

    threading.Thread(target=again, daemon=True).start()


_WIRES = {"flightstand": _flightstand, "rcbenchmark": _rcbenchmark, "serial": _serial}


def _by_hand(truth: Truth, do: str, **said: Any) -> Any:
    """What a person does at the stand."""
    match do:
        case "set up":
            return truth.set_up(**said)
        case "place":
            return truth.place(**said)
        case "at work":
            return [n for n in said["names"] if n in truth.entry.causes]
        case "output":
            return {"us": truth.us, "since": truth.changed, "now": time.monotonic()}
        case "break":
            truth.broken = said["what"]
        case "lapse":
            truth.lapse = said["to"]


def _say(said: Any) -> None:
    sys.stdout.write(json.dumps(said) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Serve one item of a sealed key until the lines end."""
    key, item, wire, lapse = sys.argv[1:]
    truth = Truth(*bench_of(Path(key), item), float(lapse))
    _say(_WIRES[wire](truth))
    _forever(truth.watch, _WATCH_S)
    for line in sys.stdin:
        _say(_by_hand(truth, **json.loads(line)))
    os._exit(0)  # threads of servers


if __name__ == "__main__":
    main()
