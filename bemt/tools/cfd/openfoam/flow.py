"""Flow of a case: fields with their boundary conditions, models, schemes, the frame that turns.

Incompressible runs take simpleFoam. Compressible runs take rhoSimpleFoam with one of two gases:

``isentropic``
    ``adiabaticPerfectFluid``: density follows pressure along the isentrope, rho = rho0 (p/p0)^(1/gamma). The energy
    equation has no say. Right for attached flow up to weak shocks.
``perfect``
    Density from the energy equation. In a turning frame that equation needs the work of pressure on moving walls,
    div(p Omega x r); version 1912 lacks the term (later ESI versions have ``fvc::div(MRF.phi(), p)`` in ``EEqn.H``), so
    the gas at a blade COOLS by U^2/2cp instead of warming by that much. Kept to show what it does.
"""

from __future__ import annotations

from typing import Any

from bemt.base.foam_text import dictionary, vector
from bemt.tools.cfd.openfoam.settings import Settings

CP = 1005.0
PRANDTL = 0.71
GAMMA = 1.4
INTENSITY = 0.01
VISCOSITY_RATIO = 5.0
DIMENSIONS = {
    "U": "[0 1 -1 0 0 0 0]", "p": "[0 2 -2 0 0 0 0]", "k": "[0 2 -2 0 0 0 0]", "omega": "[0 0 -1 0 0 0 0]",
    "epsilon": "[0 2 -3 0 0 0 0]", "nut": "[0 2 -1 0 0 0 0]", "T": "[0 0 0 1 0 0 0]", "alphat": "[1 -1 -1 0 0 0 0]",
}  # fmt: skip


def _outer(s: Settings) -> dict[str, dict[str, dict[str, Any]]]:
    """Conditions of U and p on inlet, outlet and side."""
    wind, still = f"uniform {vector(*s.wind)}", "uniform (0 0 0)"
    p = f"uniform {s.pressure:.9g}" if s.compressible else "uniform 0"
    total: dict[str, Any] = {"type": "totalPressure", "p0": p, "value": p}
    if s.compressible:
        total |= {"rho": "rho", "psi": "none", "gamma": 1}
    quiet = {"U": {"type": "pressureInletOutletVelocity", "value": still}, "p": total}
    slip = {"U": {"type": "slip"}, "p": {"type": "zeroGradient"}}
    if s.V == 0:
        return {"inlet": quiet, "outlet": quiet, "side": slip if s.domain == "pipe" else quiet}
    inlet = {"U": {"type": "fixedValue", "value": wind}, "p": {"type": "zeroGradient"}}
    outlet = {"U": {"type": "inletOutlet", "inletValue": wind, "value": wind}, "p": {"type": "fixedValue", "value": p}}
    far = {"U": {"type": "freestreamVelocity", "freestreamValue": wind, "value": wind},
           "p": {"type": "freestreamPressure", "freestreamValue": p, "value": p}}  # fmt: skip
    return {"inlet": inlet, "outlet": outlet, "side": slip if s.domain == "pipe" else far}


def _levels(s: Settings) -> dict[str, float]:
    """Turbulence far away: 1 % of the speed in the disk, five times the molecular viscosity."""
    nu = s.mu / s.rho
    k = 1.5 * (INTENSITY * max(s.V, s.slipstream)) ** 2
    omega = k / (VISCOSITY_RATIO * nu)
    return {"k": k, "omega": omega, "epsilon": 0.09 * k * omega, "nut": VISCOSITY_RATIO * nu}


def fields(s: Settings) -> dict[str, str]:
    """Write the initial fields."""
    outer, level = _outer(s), _levels(s)
    scalar = "omega" if s.turbulence == "kOmegaSST" else "epsilon"
    names = ["U", "p", "k", scalar, "nut", *(["T", "alphat"] if s.compressible else [])]
    walls = [*s.surfaces, *(["plate"] if s.plate_z is not None else [])]
    out = {}
    for name in names:
        start = {"U": f"uniform {vector(*s.wind)}", "p": f"uniform {s.pressure:.9g}" if s.compressible else "uniform 0",
                 "T": f"uniform {s.temperature:.9g}", "alphat": "uniform 0"}.get(name)  # fmt: skip
        start = start or f"uniform {level[name]:.6g}"
        conditions: dict[str, dict[str, Any]] = {
            "U": {"type": "fixedValue", "value": "uniform (0 0 0)"}, "p": {"type": "zeroGradient"},
            "k": {"type": "kqRWallFunction", "value": start}, "omega": {"type": "omegaWallFunction", "value": start},
            "epsilon": {"type": "epsilonWallFunction", "value": start},
            "nut": {"type": "nutkWallFunction", "value": "uniform 0"}, "T": {"type": "zeroGradient"},
            "alphat": {"type": "compressible::alphatWallFunction", "Prt": 0.85, "value": "uniform 0"},
        }  # fmt: skip
        boundary: dict[str, Any] = {}
        for patch, known in outer.items():
            if name in known:
                boundary[patch] = known[name]
            elif name in ("nut", "alphat"):
                boundary[patch] = {"type": "calculated", "value": start}
            elif known["U"]["type"] == "slip":
                boundary[patch] = {"type": "slip"}
            else:
                boundary[patch] = {"type": "inletOutlet", "inletValue": start, "value": start}
        boundary |= dict.fromkeys(walls, conditions[name])
        if s.sectors > 1:
            boundary |= {"side1": {"type": "cyclicAMI", "value": start}, "side2": {"type": "cyclicAMI", "value": start}}
        boundary['"proc.*"'] = {"type": "processor", "value": start}
        dimensions = "[1 -1 -2 0 0 0 0]" if name == "p" and s.compressible else DIMENSIONS[name]
        kind = "volVectorField" if name == "U" else "volScalarField"
        entries = {"dimensions": dimensions, "internalField": start, "boundaryField": boundary}
        out[name] = dictionary(name, entries, kind)
    return out


def constants(s: Settings) -> dict[str, str]:
    """Write the files of ``constant``."""
    # Periodic sides too: cyclicAMI does not count as coupled here, and the flow through it would be set to zero
    standing = [*s.walls, *(["side"] if s.domain == "pipe" else []), *(["side1", "side2"] if s.sectors > 1 else [])]
    zone = {"cellZone": "turning", "active": True, "nonRotatingPatches": standing, "origin": vector(0, 0, 0),
            "axis": vector(0, 0, 1), "omega": s.omega}  # fmt: skip
    ras = {"RASModel": s.turbulence, "turbulence": True, "printCoeffs": False}
    out = {
        "MRFProperties": dictionary("MRFProperties", {"rotor": zone}, note=f"{s.rpm:g} rev/min"),
        "turbulenceProperties": dictionary("turbulenceProperties", {"simulationType": "RAS", "RAS": ras}),
    }
    if not s.compressible:
        transport = {"transportModel": "Newtonian", "nu": s.mu / s.rho}
        return out | {"transportProperties": dictionary("transportProperties", transport)}
    isentropic = s.gas == "isentropic"
    kind = {
        "type": "heRhoThermo" if isentropic else "hePsiThermo", "mixture": "pureMixture", "transport": "const",
        "thermo": "hConst", "equationOfState": "adiabaticPerfectFluid" if isentropic else "perfectGas",
        "specie": "specie", "energy": "sensibleEnthalpy",
    }  # fmt: skip
    mixture: dict[str, Any] = {
        "specie": {"molWeight": 8314.46 / 287.05},
        "thermodynamics": {"Cp": CP, "Hf": 0},
        "transport": {"mu": s.mu, "Pr": PRANDTL},
    }
    if isentropic:
        mixture["equationOfState"] = {"p0": s.pressure, "rho0": s.rho, "gamma": GAMMA, "B": 0}
    limit = {"type": "limitTemperature", "active": True, "selectionMode": "all", "min": 0.6 * s.temperature,
             "max": 1.6 * s.temperature}  # fmt: skip
    out["thermophysicalProperties"] = dictionary("thermophysicalProperties", {"thermoType": kind, "mixture": mixture})
    return out | {"fvOptions": dictionary("fvOptions", {"limit": limit})}


def schemes(s: Settings) -> str:
    """Write ``fvSchemes``: second order for momentum, first for turbulence."""
    upwind = "bounded Gauss upwind"
    div: dict[str, Any] = {"default": "none", "div(phi,U)": "bounded Gauss linearUpwind limited",
                           **{f"div(phi,{name})": upwind for name in ("k", "omega", "epsilon")}}  # fmt: skip
    if s.compressible:
        div |= {"div(phi,h)": upwind, "div(phi,K)": upwind, "div(phi,Ekp)": upwind,
                "div(((rho*nuEff)*dev2(T(grad(U)))))": "Gauss linear"}  # fmt: skip
    else:
        div |= {"div((nuEff*dev2(T(grad(U)))))": "Gauss linear"}
    return dictionary("fvSchemes", {
        "ddtSchemes": {"default": "steadyState"},
        "gradSchemes": {"default": "cellLimited Gauss linear 1", "grad(p)": "Gauss linear",
                        "limited": "cellLimited Gauss linear 1"},
        "divSchemes": div, "laplacianSchemes": {"default": "Gauss linear limited corrected 0.33"},
        "interpolationSchemes": {"default": "linear"}, "snGradSchemes": {"default": "limited corrected 0.33"},
        "wallDist": {"method": "meshWave"},
    })  # fmt: skip


def solution(s: Settings) -> str:
    """Write ``fvSolution``: SIMPLE with p 0.3 and U 0.6; SIMPLEC diverged."""
    smooth = {"solver": "smoothSolver", "smoother": "symGaussSeidel", "tolerance": 1e-9, "relTol": 0.1}
    simple: dict[str, Any] = {"nNonOrthogonalCorrectors": 0, "consistent": False}
    relax: dict[str, Any] = {"p": 0.3}
    if s.compressible:
        simple |= {"pMinFactor": 0.3, "pMaxFactor": 2.0, "transonic": False}
        relax["rho"] = 0.3
    return dictionary("fvSolution", {
        "solvers": {
            "p": {"solver": "GAMG", "smoother": "GaussSeidel", "tolerance": 1e-9, "relTol": 0.1, "maxIter": 30},
            '"(U|k|omega|epsilon|h)"': smooth,
        },
        "SIMPLE": simple,
        "relaxationFactors": {"fields": relax, "equations": {"U": 0.6, '"(k|omega|epsilon|h)"': 0.5}},
    })  # fmt: skip
