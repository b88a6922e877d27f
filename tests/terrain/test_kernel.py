import hashlib
import pickle
from pathlib import Path
from typing import Any

import pytest
from numba import __version__ as numba_version

from fti import kernel
from fti.terrain import ray_cast, surface
from tests.terrain_kernels import warm_up

#: The class ``fti.terrain.pyramid.Renamed``, which is not there: pickle refers to a class by its name.
MISSING_CLASS = b"cfti.terrain.pyramid\nRenamed\n."


def test_the_cache_knows_the_files_of_all_kernels_that_are_called() -> None:
    files = {Path(path).name for path in kernel._files(ray_cast.cast_rays)}
    assert files == {
        *("ray_cast.py", "ray_state.py", "ray_walk.py", "memory.py"),
        *("pyramid.py", "pyramid_nodes.py", "surface.py", "formulas.py"),
    }
    stamp = ray_cast.cast_rays._cache._cache_file._source_stamp  # type: ignore[attr-defined]
    assert (surface.__file__, hashlib.sha256(Path(surface.__file__).read_bytes()).hexdigest()) in stamp


@pytest.mark.parametrize("damage", [b"", MISSING_CLASS, b"\x80\x05]"], ids=["empty", "renamed class", "cut off"])
@pytest.mark.parametrize("pattern", ["*.nbi", "*.nbc"])
def test_an_unreadable_file_of_compiled_code_counts_as_missing(tmp_path: Path, pattern: str, damage: bytes) -> None:
    code: Any = kernel.KernelCacheFile(str(tmp_path), "kernel", "stamp")  # type: ignore[no-untyped-call]
    code.save("signature", "machine code")
    assert code.load("signature") == "machine code"
    (file,) = tmp_path.glob(pattern)
    file.write_bytes((pickle.dumps(numba_version, protocol=-1) if pattern == "*.nbi" else b"") + damage)
    assert code.load("signature") is None
    code.save("signature", "machine code")
    assert code.load("signature") == "machine code"


def test_code_of_another_version_of_the_source_is_not_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    warm_up()
    assert kernel.is_cached(ray_cast.cast_rays)
    monkeypatch.setattr(ray_cast.cast_rays._cache._cache_file, "_source_stamp", [("ray_cast.py", "0")])  # type: ignore[attr-defined]
    assert not kernel.is_cached(ray_cast.cast_rays)
