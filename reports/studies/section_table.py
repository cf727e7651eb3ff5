"""Make the shipped table of NACA four-digit sections, bemt/physics/sections/four_digit.npz, by runs of NeuralFoil.

``python reports/studies/section_table.py write`` makes the table (20 s); ``check`` compares it with NeuralFoil at
random sections, table and rotor (1 min). Both need ``pip install "bemt[neuralfoil]"``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bemt.base import cache
from bemt.physics.sections import neuralfoil
from bemt.physics.sections.polars import DEFAULT_RE
from geometry.airfoil import naca4

NODES = {
    "position": [0.40, 0.45],
    "camber": [0.0, 0.01, 0.02, 0.03, 0.035, 0.04, 0.05, 0.06, 0.07, 0.08],
    "thickness": [0.06, 0.07, 0.08, 0.09, 0.10, 0.11, 0.12],
    "n_crit": [1.0, 2.0, 3.0, 5.0, 7.0, 9.0],
}
"""Nodes: the rule's numbers and the ends of its declared ranges are among them."""
RE = np.append(DEFAULT_RE[DEFAULT_RE >= neuralfoil.RE_LOWEST * (1.0 - 1e-12)], neuralfoil.RE_REFERENCE)


def run(camber: float, position: float, thickness: float, n_crit: float) -> np.ndarray:
    """cl, ln cd and confidence of one section, (3, Na, Nr)."""
    raw = neuralfoil.ask(naca4(camber, position, thickness), RE, n_crit)
    return np.stack([raw.cl, np.log(raw.cd), raw.confidence])


def pack(values: np.ndarray) -> np.ndarray:
    """Round to `neuralfoil.STEPS` and take differences along camber, thickness and n_crit: bytes that compress well.

    Confidence is rounded to the middle of its unit: what was above one half stays so.
    """
    units = [np.rint(values[..., 0, :, :] / neuralfoil.STEPS[0]), np.rint(values[..., 1, :, :] / neuralfoil.STEPS[1]),
             np.floor(values[..., 2, :, :] / neuralfoil.STEPS[2])]  # fmt: skip
    whole = np.stack(units, axis=4).astype(np.int32)
    for axis in (1, 2, 3):
        whole = np.diff(whole, axis=axis, prepend=0)
    flat = whole.astype("<i2")
    if not np.array_equal(flat, whole):
        raise ValueError("got differences beyond 16 bits; expected a finer grid")
    return np.ascontiguousarray(np.moveaxis(flat.view(np.uint8).reshape(*flat.shape, 2), -1, 0))


def write(path: Path) -> None:
    """Make the table."""
    shape = tuple(len(NODES[name]) for name in neuralfoil.AXES)
    values = np.empty((*shape, 3, neuralfoil.RAW_DEG.size, RE.size))
    for at in np.ndindex(shape):
        p, m, t, n = (NODES[name][i] for name, i in zip(neuralfoil.AXES, at, strict=True))
        values[at] = run(m, p, t, n)
    nodes = {name: np.array(NODES[name]) for name in neuralfoil.AXES}
    made_with = f"NeuralFoil {cache.installed_version('neuralfoil')} xlarge"
    np.savez_compressed(path, packed=pack(values), alpha_deg=neuralfoil.RAW_DEG, Re=RE,
                        made_with=np.array(made_with), **nodes)  # fmt: skip
    print(f"{path}: {values.shape}, {path.stat().st_size / 1e6:.2f} MB, {made_with}")


def check(count: int) -> None:
    """Errors of the table at random sections: cl and cd from -4 to 10 deg, CT and CP of a 10x5 that has them."""
    from bemt import propeller
    from bemt.physics.bem.model import Model

    random = np.random.default_rng(1)
    rotor = propeller("10x5").case.rotor()
    J, rpm = (v.ravel() for v in np.meshgrid([0.0, 0.2, 0.4, 0.55], [3000.0, 6000.0, 10000.0]))
    static = np.array([[0.1], [0.05]])  # about its CT and CP at rest
    small, loads = [], []
    for _ in range(count):
        shape = random.uniform(0.02, 0.07), 0.40, random.uniform(0.06, 0.12)
        n_crit = float(random.uniform(1.0, 9.0))
        both = []
        for known in (True, False):
            section = naca4(*shape)
            if not known:  # of unknown family: NeuralFoil is asked
                section = type(section)(section.name, section.x, section.y)
            polar = neuralfoil.neuralfoil_polar(section, n_crit)
            found = Model(rotor, [(0.0, polar)]).solve(rpm, J * rpm / 60.0 * rotor.D)
            both.append((polar, np.array([found.CT, found.CP])))
        (a, coarse), (b, exact) = both
        near = (np.degrees(a.alpha) >= -4.0) & (np.degrees(a.alpha) <= 10.0)
        known_Re = (a.Re >= 3e4) & (a.Re <= 1e6)
        cl, ln_cd = (np.abs(x - y)[near][:, known_Re] for x, y in ((a.cl, b.cl), (np.log(a.cd), np.log(b.cd))))
        small.append([cl, ln_cd])
        loads.append(np.abs(coarse - exact) / static)
    print("cl, ln cd from -4 to 10 deg, Re 3e4 to 1e6; CT, CP over those at rest")
    errors = [*np.moveaxis(np.array(small), 1, 0), *np.moveaxis(np.array(loads), 1, 0)]
    for label, of in zip(("cl", "ln cd", "CT", "CP"), errors, strict=True):
        print(f"{label:>5}: median {np.median(of):.2e}, 95 % {np.quantile(of, 0.95):.2e}, most {of.max():.2e}")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", choices=("write", "check"))
    parser.add_argument("--sections", type=int, default=60)
    args = parser.parse_args()
    if args.task == "write":
        write(Path(neuralfoil.__file__).with_name(neuralfoil.FILE))
    else:
        check(args.sections)


if __name__ == "__main__":
    main()
