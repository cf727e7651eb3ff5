"""Thrust and torque of a rotor as a component of OpenMDAO, with derivatives (extra ``simulators``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.physics.bem.gradient import gradient, loads

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.model import Model
    from bemt.physics.effects import Effect
    from geometry.blade import Stations


def rotor_component(model: Model, effects: Sequence[Effect], air: Air) -> Any:
    """Make a component of one rotor."""
    import openmdao.api as om

    start = model.rotor.blade.midpoints(model.n_stations, spacing="cosine")

    class RotorComponent(om.ExplicitComponent):  # type: ignore[misc]
        """BEMT with derivatives by independent annuli."""

        def setup(self) -> None:
            self.add_input("chord", start.chord, units="m")
            self.add_input("beta", start.beta, units="rad")
            self.add_input("rpm", 6000.0, units="rpm")
            self.add_input("airspeed", 0.0, units="m/s")
            self.add_input("density", air.rho, units="kg/m**3")
            self.add_output("thrust", units="N")
            self.add_output("torque", units="N*m")
            self.declare_partials("*", "*")

        def _at(self, inputs: Any) -> tuple[float, float, Air, Stations]:
            stations = start._replace(chord=np.array(inputs["chord"]), beta=np.array(inputs["beta"]))
            here = replace(air, rho=float(inputs["density"].item()))
            return inputs["rpm"].item(), inputs["airspeed"].item(), here, stations

        def compute(self, inputs: Any, outputs: Any) -> None:
            outputs["thrust"], outputs["torque"] = loads(model, effects, *self._at(inputs))

        def compute_partials(self, inputs: Any, partials: Any) -> None:
            found = gradient(model, effects, *self._at(inputs))
            for k, name in enumerate(("thrust", "torque")):
                partials[name, "chord"], partials[name, "beta"] = found.chord[k], found.beta[k]
                partials[name, "rpm"], partials[name, "airspeed"] = found.rpm[k], found.airspeed[k]
                partials[name, "density"] = found.density[k]

    return RotorComponent()
