"""The kernel cache: loads in a second process, and never answers with stale code."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from ident.simulation.compiled import compiled, passed, specialised, unrolled

LOW = """
from ident.simulation.compiled import compiled, specialised
SCALE = {scale}
@compiled
def scaled(x):
    return SCALE * x
@specialised
def applied(function, x):
    return function(x) + 1.0
"""
HIGH = """
import warnings
warnings.simplefilter("error")
from ident.simulation.compiled import compiled, passed
from low import applied, scaled
FUNCTION = passed(scaled)
@compiled
def top(x):
    return applied(FUNCTION, x)
print(top(1.0), sum(top.stats.cache_hits.values()))
"""

BY_ADDRESS = """
import warnings
warnings.simplefilter("error")
from numba import float64
from ident.simulation.compiled import address_of, calls, compiled
from low import scaled
SIGNATURE = float64(float64)
call = calls(SIGNATURE)
@compiled
def top(address, x):
    return call(address, (x,)) + 1.0
print(top(address_of(scaled, SIGNATURE), 1.0), sum(top.stats.cache_hits.values()))
"""

NO_KERNELS = """
from typing import NamedTuple
from llvmlite import ir
from numba import float64, int64
from ident.simulation.compiled import address_of, calls, compiled, generated
SCALE = {scale}
@generated
def scaled(context, x):
    def generate(context, builder, sig, args):
        return builder.fmul(args[0], ir.Constant(ir.DoubleType(), SCALE))
    return float64(float64), generate
class Pair(NamedTuple):
    {fields[0]}: float
    {fields[1]}: float
FORM = float64({kind})
call = calls(FORM)
@compiled
def halved(x):
    return x / 2
def address():
    return address_of(halved, FORM)
"""
BY_NO_KERNELS = """
from low import Pair, address, call, scaled
from ident.simulation.compiled import compiled
@compiled
def generated(x):
    return scaled(x)
@compiled
def kept(x):
    return Pair(x, 10.0 * x).kept
@compiled
def called(address, x):
    return call(address, (x,))
total = generated(100.0) + kept(1.0) + called(address(), 1.5)
print(total, sum(sum(kernel.stats.cache_hits.values()) for kernel in (generated, kept, called)))
"""


def run(folder: Path) -> tuple[float, int]:
    root = Path(__file__).parents[3]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), str(folder)])}
    out = subprocess.run(
        [sys.executable, "high.py"], cwd=folder, env=environment, capture_output=True, text=True, check=True
    ).stdout
    value, hits = out.split()
    return float(value), int(hits)


def test_a_second_process_loads_and_an_edit_of_a_called_module_recompiles(tmp_path: Path) -> None:
    (tmp_path / "high.py").write_text(HIGH)
    (tmp_path / "low.py").write_text(LOW.format(scale=2.0))
    assert run(tmp_path) == (3.0, 0)
    assert run(tmp_path) == (3.0, 1)
    (tmp_path / "low.py").write_text(LOW.format(scale=5.0))
    assert run(tmp_path) == (6.0, 0)


def test_a_kernel_called_by_its_address_is_never_stale_and_its_caller_not_compiled_again(
    tmp_path: Path,
) -> None:
    (tmp_path / "high.py").write_text(BY_ADDRESS)
    (tmp_path / "low.py").write_text(LOW.format(scale=2.0))
    assert run(tmp_path) == (3.0, 0)
    assert run(tmp_path) == (3.0, 1)
    (tmp_path / "low.py").write_text(LOW.format(scale=5.0))
    assert run(tmp_path) == (6.0, 1)


def test_an_edit_of_what_is_no_kernel_recompiles(tmp_path: Path) -> None:
    """Of what generates machine code, of a tuple's fields, and of the signature at an address."""
    (tmp_path / "high.py").write_text(BY_NO_KERNELS)
    (tmp_path / "low.py").write_text(NO_KERNELS.format(scale=2.0, fields=("kept", "other"), kind="float64"))
    assert run(tmp_path) == (200.0 + 1.0 + 0.75, 0)
    assert run(tmp_path) == (200.0 + 1.0 + 0.75, 3)
    (tmp_path / "low.py").write_text(NO_KERNELS.format(scale=5.0, fields=("other", "kept"), kind="int64"))
    assert run(tmp_path) == (500.0 + 10.0 + 0.5, 0)


@specialised
def turn(i: int, carried: Any, given: float) -> Any:
    total, product = carried
    for j in range(i):
        total += given * j
    return total, product * i


TURN = passed(turn)


@compiled
def turns(given: float) -> tuple[float, float]:
    total, product = unrolled(TURN, 2, 7, (0.0, 1.0), given)
    return float(total), float(product)


def test_an_unrolled_loop_takes_every_turn_in_order() -> None:
    assert turns(0.5) == (0.5 * sum(j for i in range(2, 7) for j in range(i)), 720.0)
