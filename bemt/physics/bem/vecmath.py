"""Elementary functions for the compiled kernel, without branches and calls, so that loops over them become SIMD code.

All are accurate to a few units in the last place over the arguments that the kernel forms.  Coefficients: sine, cosine
and logarithm from fdlibm (Sun Microsystems 1993), arc tangent from Cephes (Moshier 1989).
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, disable-error-code="attr-defined"
# (numba erases signatures)

from __future__ import annotations

import logging
import math
import zlib
from contextlib import suppress
from functools import cache
from multiprocessing import parent_process
from types import ModuleType
from typing import Any

import numpy as np
from numba import njit as _njit
from numba import types
from numba.core.caching import NullCache
from numba.extending import intrinsic as _intrinsic

# Keeps NaN and infinity as they are; lets sums over stations run in SIMD lanes.
_FAST = {"contract", "reassoc", "nsz", "arcp"}


def njit(function: Any) -> Any:
    """Compile an entry point: lazily, without the interpreter lock, kept on disk where a folder can be written."""
    made = _njit(nogil=True, error_model="numpy", fastmath=_FAST)(function)
    with suppress(RuntimeError):  # "no locator available": a read-only installation without a home
        made.enable_caching()
    return made


@cache
def _say_unkept() -> None:
    if parent_process() is None:
        logging.getLogger("bemt").warning(
            "No folder can be written for compiled code: each start compiles anew, some seconds. "
            "Set NUMBA_CACHE_DIR to a folder that can be written."
        )


def ready(compiled: Any) -> Any:
    """Entry point that is about to run; says once if what it compiles to cannot be kept."""
    if isinstance(compiled._cache, NullCache) and not compiled.signatures:
        _say_unkept()
    return compiled


def inlined(function: Any) -> Any:
    """Compile a function that always disappears into its caller; nothing but compiled code can call it."""
    # entries from outside, which nobody uses, are an eighth of the time that a kernel takes to compile
    alone: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return _njit(forceinline=True, nogil=True, error_model="numpy", fastmath=_FAST, **alone)(function)


def intrinsic(function: Any) -> Any:
    """Function whose machine code is written out by hand."""
    return _intrinsic(function)


def fingerprint(*modules: ModuleType) -> int:
    """Number that changes when a compiled function or a numeric constant of the modules does."""
    total = 0
    for module in modules:
        for name, item in sorted(vars(module).items()):
            code = getattr(getattr(item, "py_func", None), "__code__", None)
            if code is not None:
                total = zlib.crc32(repr((name, code.co_code, code.co_consts, code.co_names)).encode(), total)
            elif isinstance(item, int | float):
                total = zlib.crc32(repr((name, item)).encode(), total)
    return total


@intrinsic
def _bits(typingctx, x):
    """Bit pattern of a double."""

    def codegen(context, builder, signature, args):
        return builder.bitcast(args[0], context.get_value_type(types.int64))

    return types.int64(types.float64), codegen


@intrinsic
def _double(typingctx, x):
    """Double with a given bit pattern."""

    def codegen(context, builder, signature, args):
        return builder.bitcast(args[0], context.get_value_type(types.float64))

    return types.float64(types.int64), codegen


@intrinsic
def wide(typingctx):
    """Let the loops of the calling function use the widest SIMD registers there are; compilers default to half."""

    def codegen(context, builder, signature, args):
        # the method `add` of llvmlite's attribute set refuses attributes with a value
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.none(), codegen


@inlined
def sincos(x):
    """Sine and cosine of ``|x| < 100`` [rad]."""
    n = math.floor(x * (2.0 / math.pi) + 0.5)
    r = x - n * (0.5 * math.pi)
    z = r * r
    p = 1.58969099521155010221e-10
    p = -2.50507602534068634195e-08 + z * p
    p = 2.75573137070700676789e-06 + z * p
    p = -1.98412698298579493134e-04 + z * p
    p = 8.33333333332248946124e-03 + z * p
    p = -1.66666666666666324348e-01 + z * p
    sine = r + r * z * p
    p = -1.13596475577881948265e-11
    p = 2.08757232129817482790e-09 + z * p
    p = -2.75573143513906633035e-07 + z * p
    p = 2.48015872894767294178e-05 + z * p
    p = -1.38888888888741095749e-03 + z * p
    p = 4.16666666666666019037e-02 + z * p
    cosine = 1.0 - 0.5 * z + z * z * p
    q = np.int32(n)
    s = cosine if (q & 1) != 0 else sine
    c = sine if (q & 1) != 0 else cosine
    return -s if (q & 2) != 0 else s, -c if ((q + 1) & 2) != 0 else c


@inlined
def atan2(y, x):
    """Angle of the point (x, y), -pi to pi [rad]; NaN at the origin."""
    ax = abs(x)
    ay = abs(y)
    big = ax if ax > ay else ay
    t = (ay if ax > ay else ax) / big
    far = t > 0.41421356237309503
    u = (t - 1.0) / (t + 1.0) if far else t
    z = u * u
    p = -8.750608600031904122785e-1
    p = -1.615753718733365076637e1 + z * p
    p = -7.500855792314704667340e1 + z * p
    p = -1.228866684490136173410e2 + z * p
    p = -6.485021904942025371773e1 + z * p
    q = 2.485846490142306297962e1 + z
    q = 1.650270098316988542046e2 + z * q
    q = 4.328810604912902668951e2 + z * q
    q = 4.853903996359136964868e2 + z * q
    q = 1.945506571482613964425e2 + z * q
    a = u + u * z * (p / q)
    a = a + 0.25 * math.pi if far else a
    a = 0.5 * math.pi - a if ay > ax else a
    a = math.pi - a if x < 0.0 else a
    return -a if y < 0.0 else a


@inlined
def log(x):
    """Natural logarithm of a positive normal number."""
    bits = _bits(x)
    # exponent of x / sqrt(1/2), so that the mantissa lies between sqrt(1/2) and sqrt(2)
    k = (bits - 0x3FE6A09E667F3BCD) >> 52
    f = _double(bits - (k << 52)) - 1.0
    s = f / (2.0 + f)
    z = s * s
    p = 1.479819860511658591e-01
    p = 1.531383769920937332e-01 + z * p
    p = 1.818357216161805012e-01 + z * p
    p = 2.222219843214978396e-01 + z * p
    p = 2.857142874366239149e-01 + z * p
    p = 3.999999999940941908e-01 + z * p
    p = 6.666666666666735130e-01 + z * p
    h = 0.5 * f * f
    return np.int32(k) * 0.69314718055994530942 + (f - (h - s * (h + z * p)))
