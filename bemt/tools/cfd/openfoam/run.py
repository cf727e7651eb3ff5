"""Running a case: ``controlDict`` with the forces that are recorded, and ``Allrun``."""

from __future__ import annotations

from bemt.base.foam_text import dictionary, vector
from bemt.tools.cfd.openfoam.settings import Settings

BINS = 24
"""Bins along the radius in which the blade's loads are recorded."""
OPEN = ("inlet", "outlet", "side")
"""Patches at the ends of the domain."""
SIDES = ("side1", "side2")
"""Periodic sides of a sector."""
BALANCE = 10
"""How often the averaged iterations are balanced."""


def _forces(s: Settings, patches: list[str], **more: object) -> dict[str, object]:
    out: dict[str, object] = {"type": "forces", "libs": '("libforces.so")', "patches": patches, "CofR": vector(0, 0, 0),
                           "log": False, "writeControl": "timeStep", "writeInterval": 1}  # fmt: skip
    return out | ({"pRef": s.pressure} if s.compressible else {"rho": "rhoInf", "rhoInf": s.rho, "pRef": 0}) | more


def through(s: Settings) -> tuple[str, ...]:
    """Patches that air passes."""
    return (*OPEN, *(SIDES if s.sectors > 1 else ()))


def _balance(s: Settings) -> dict[str, object]:
    """Function objects of the balance: flux and momentum through every patch, pressure and shear on it."""
    step = max(1, s.average // BALANCE)
    when = {"timeStart": s.iterations - s.average + 1, "executeControl": "timeStep", "executeInterval": step,
            "writeControl": "timeStep", "writeInterval": step}  # fmt: skip
    out: dict[str, object] = {}
    for patch in through(s):
        common = {"type": "surfaceFieldValue", "libs": '("libfieldFunctionObjects.so")', "log": False,
                  "regionType": "patch", "name": patch, "surfaceFormat": "raw", "writeFields": True} | when  # fmt: skip
        out[f"mass_{patch}"] = {**common, "operation": "sum", "fields": ["phi"]}
        out[f"momentum_{patch}"] = {**common, "operation": "weightedSum", "weightField": "phi", "fields": ["U"]}
    out["open"] = _forces(s, list(OPEN)) | when
    if s.sectors > 1:
        out["sides"] = _forces(s, list(SIDES)) | when
    return out


def control(s: Settings, balance: bool = True) -> str:
    """Write ``controlDict``.

    ``forces`` holds blade and hub of the sector that is solved; ``standing`` duct, stator and centre body; ``plate``
    the plate; ``radial`` the blade in bins along x, which blade 1 lies on (no bins for the whole rotor). ``mass_...``,
    ``momentum_...``, ``open`` and ``sides`` are for :mod:`bemt.tools.cfd.balance`.
    """
    functions: dict[str, object] = {"forces": _forces(s, ["blade", "hub"])}
    standing = [name for name in s.walls if name != "plate"]
    if standing:
        functions["standing"] = _forces(s, standing)
    if s.plate_z is not None:
        functions["plate"] = _forces(s, ["plate"])
    if s.sector != "full":
        bins = {"nBin": BINS, "direction": vector(1, 0, 0), "cumulative": False}
        functions["radial"] = _forces(
            s, ["blade"], binData=bins, executeControl="timeStep", executeInterval=10, writeInterval=10
        )
    functions["yPlus"] = {"type": "yPlus", "libs": '("libfieldFunctionObjects.so")', "log": False,
                          "executeControl": "timeStep", "executeInterval": s.iterations,
                          "writeControl": "timeStep", "writeInterval": s.iterations}  # fmt: skip
    if balance:
        functions |= _balance(s)
    return dictionary("controlDict", {
        "application": "rhoSimpleFoam" if s.compressible else "simpleFoam", "startFrom": "startTime", "startTime": 0,
        "stopAt": "endTime", "endTime": s.iterations, "deltaT": 1, "writeControl": "timeStep",
        "writeInterval": s.iterations, "purgeWrite": 1, "writeFormat": "binary", "writePrecision": 8,
        "timeFormat": "general", "timePrecision": 8, "runTimeModifiable": False, "functions": functions,
    })  # fmt: skip


_SCRIPT = r"""#!/bin/bash
# @TITLE@
#   ./Allrun          grid, solution, result      ./Allrun mesh | solve | report   one step of it
#   NP=4 ./Allrun     with four processes (default @RANKS@; 1 runs without MPI)
# Exit code: 0 fine, 1 a program failed, 3 diverged.
cd "${0%/*}" || exit 1
if [ -z "$WM_PROJECT_DIR" ] && [ -d /usr/share/openfoam ]; then export WM_PROJECT_DIR=/usr/share/openfoam; fi
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_btl_base_warn_component_unused=0
NP=${NP:-@RANKS@}
step=${1:-all}

for program in blockMesh snappyHexMesh @SOLVER@; do
    command -v "$program" > /dev/null || { echo "$program not found: OpenFOAM is not installed" >&2; exit 1; }
done

failed() {
    echo "$1 failed; the end of log.$1:" >&2
    tail -n 15 "log.$1" >&2
    exit 1
}
serial() { echo "$1"; "$@" > "log.$1" 2>&1 || failed "$1"; }
parallel() {
    if [ "$NP" -eq 1 ]; then serial "$@"; return; fi
    echo "$1 on $NP processes"
    mpirun -np "$NP" "$@" -parallel > "log.$1" 2>&1 || failed "$1"
}
# folders in $1 that are named by a number alone, with $2 before it
numbered() {
    for d in "$1"/"$2"*/; do
        d=${d%/} && n=${d##*/} && n=${n#"$2"}
        case $n in "" | *[!0-9]*) continue ;; esac
        [ -L "$d" ] || echo "$d"
    done
}
# a folder 2024 of yours has no fields: it is no time of a run
is_time() {
    for f in U p uniform polyMesh; do if [ -e "$1/$f" ]; then return 0; fi; done
    [ "${1##*/}" = 0 ] || [ -z "$(ls -A "$1")" ]
}
clear_times() { numbered "$1" "" | while IFS= read -r old; do if is_time "$old"; then rm -rf "$old"; fi; done; }
clear_processors() { numbered . processor | while IFS= read -r old; do rm -rf "$old"; done; }
each() { if [ "$NP" -eq 1 ]; then "$1" .; else for part in $(numbered . processor); do "$1" "$part"; done; fi; }
start_fields() { clear_times "$1"; cp -r 0.orig "$1/0"; }

if [ "$step" = all ] || [ "$step" = mesh ]; then
    rm -rf constant/polyMesh postProcessing
    clear_processors
    clear_times .
    cat > system/decomposeParDict << EOF
FoamFile { version 2.0; format ascii; class dictionary; object decomposeParDict; }
numberOfSubdomains $NP;
method hierarchical;
coeffs { n (1 $NP 1); order xyz; delta 0.001; }
EOF
    serial blockMesh
    if [ "$NP" -gt 1 ]; then serial decomposePar; fi
    parallel snappyHexMesh -overwrite
    parallel topoSet
    parallel createPatch -overwrite
    parallel checkMesh
    grep -E "^ *cells: |Max aspect|Mesh OK|Failed" log.checkMesh
fi

if [ "$step" = all ] || [ "$step" = solve ]; then
    rm -rf postProcessing
    each start_fields
    parallel setFields
    if [ -x ./start ]; then ./start || { echo "start failed" >&2; exit 1; }; fi
    parallel @SOLVER@
fi

if [ "$step" != mesh ]; then
    last=@AVERAGE@
    # means of the last rows, times the number of sectors; drift: line of least squares over them, of the mean
    awk -v last=$last -v sectors=@SECTORS@ -v turn=@ROTATION@ -v most=@ITERATIONS@ '
        function mean(v, n,  i, s) { s = 0; for (i = n - m + 1; i <= n; i++) s += v[i]; return s / m }
        function drift(v, n, a,  i, x, top, low) {
            top = low = 0
            for (i = n - m + 1; i <= n; i++) { x = i - n + (m - 1) / 2; top += x * v[i]; low += x * x }
            return (m > 1 && a != 0) ? 100 * top / low * (m - 1) / (a < 0 ? -a : a) : 0
        }
        FNR == 1 { file++ }
        /^#/ { next }
        { gsub(/[()]/, " "); $0 = $0; if ($0 ~ /nan|inf/) bad = 1 }
        file == 1 { T[++n] = sectors * $4 }
        file == 2 { Q[++q] = -turn * sectors * $4 }
        END {
            if (n == 0 || n != q) { print "no forces were recorded"; exit 3 }
            m = (last < n) ? last : n
            t = mean(T, n); s = mean(Q, n)
            printf "thrust %.6g N (drift %+.2f %%), ", t, drift(T, n, t)
            printf "torque %.6g N m (drift %+.2f %%)\n", s, drift(Q, n, s)
            printf "means of the last %d of %d iterations, times %d sectors\n", m, n, sectors
            size = (t < 0 ? -t : t)
            if (bad || size > @LIMIT@ || n < most) { print "diverged"; exit 3 }
        }' postProcessing/forces/0/force.dat postProcessing/forces/0/moment.dat || exit 3
fi
"""


def all_run(s: Settings, title: str) -> str:
    """Write ``Allrun``: bash and OpenFOAM are all that it needs."""
    limit = 100 * s.rho * (s.rpm / 60) ** 2 * (2 * s.R) ** 4
    words = {"TITLE": " ".join(title.split()), "RANKS": s.ranks,
             "SOLVER": "rhoSimpleFoam" if s.compressible else "simpleFoam",
             "AVERAGE": s.average, "SECTORS": s.sectors, "ROTATION": s.rotation, "ITERATIONS": s.iterations,
             "LIMIT": f"{limit:.6g}"}  # fmt: skip
    text = _SCRIPT
    for key, value in words.items():
        text = text.replace(f"@{key}@", str(value))
    return text
