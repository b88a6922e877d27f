import hashlib
from pathlib import Path

from fti.terrain import kernel, ray_cast, surface


def test_the_cache_knows_the_files_of_all_kernels_that_are_called() -> None:
    files = {Path(path).name for path in kernel._files(ray_cast.cast_rays)}
    assert files == {"cast.py", "surface.py", "pyramid.py"}
    stamp = ray_cast.cast_rays._cache._cache_file._source_stamp  # type: ignore[attr-defined]
    assert (surface.__file__, hashlib.sha256(Path(surface.__file__).read_bytes()).hexdigest()) in stamp
