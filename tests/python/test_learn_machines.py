"""The same recordings give the same model on every machine (L14)."""

import machines
import mocap_files as files
import pytest


def test_machines_that_calculate_otherwise_write_the_same_bytes(tmp_path):
    played = machines.environments()
    if len(played) < 2:
        pytest.skip("this CPU, or another algebra than OpenBLAS's, leaves numpy no choice of kernels")
    for i in range(8):
        motion = {"period": 110.0 + 5 * i, "offset": 13.0 * i, "swing": 0.85 + 0.05 * i, "seed": i}
        files.write_toy(tmp_path / "walks", f"{i // 2:02}_{i % 2:02}", speed=1.1 + 0.05 * i, **motion)
    least, *_, most = played
    found = {
        name: machines.learn(played[name], tmp_path / "m.gait", tmp_path / "walks") for name in (least, most)
    }
    assert len(set(found.values())) == 1, found
