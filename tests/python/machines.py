"""Other x86-64 machines simulated on this one: kernels of the linear algebra, of numpy and of libm.

Each is an environment for a separate process, because kernels are chosen when libraries are loaded.
"""

import hashlib
import os
import platform
import subprocess
import sys
from pathlib import Path

from numpy._core._multiarray_umath import __cpu_dispatch__ as FEATURES

BROAD = [name for name in FEATURES if "V4" in name or "512" in name]
PLAYED = {  # name: what the CPU must have, OpenBLAS's kernels, numpy's that are off, glibc's that are off
    "SSE": ((), "Nehalem", FEATURES, "-FMA,-FMA4,-AVX2"),
    "AVX2": (("avx2", "fma"), "Haswell", BROAD, ""),
    "AVX-512": (("avx512f", "avx512bw", "avx512dq", "avx512vl"), "SkylakeX", (), ""),
}

BITS = """
import hashlib, numpy as np
from numpy.random import default_rng
x = default_rng(0).normal(size=(400, 300))
parts = (x.T @ x, np.linalg.svd(x)[1], np.sin(x), np.exp(x))
print(*(hashlib.sha256(part.tobytes()).hexdigest() for part in parts))
"""


def environments():
    """Environment of each kind of machine that this one can simulate and whose bits differ."""
    if platform.machine() not in ("x86_64", "AMD64") or not Path("/proc/cpuinfo").is_file():
        return {}
    has = Path("/proc/cpuinfo").read_text().split("flags", 1)[1].split("\n", 1)[0].split()
    found = {}
    for name, (needs, core, off, tuned) in PLAYED.items():
        if set(needs) <= set(has):
            made = {"OPENBLAS_CORETYPE": core, "NPY_DISABLE_CPU_FEATURES": " ".join(off)}
            found[name] = {**os.environ, **made, "GLIBC_TUNABLES": f"glibc.cpu.hwcaps={tuned}" * bool(tuned)}
    bits = {name: _run(environment, "-c", BITS) for name, environment in found.items()}
    return {name: found[name] for name in {bits[name]: name for name in found}.values()}


def _run(environment, *words):
    done = subprocess.run([sys.executable, *words], env=environment, capture_output=True, check=True)
    return done.stdout


def learn(environment, output, *words):
    """Hash of the model that `gait learn` writes in this environment."""
    _run(environment, "-m", "gait", "learn", *map(str, words), "-o", str(output), "--quiet")
    return hashlib.sha256(Path(output).read_bytes()).hexdigest()
