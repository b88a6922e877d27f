import hashlib
from pathlib import Path

from fti.terrain import cast, kernel, surface


def test_the_cache_knows_the_files_of_all_kernels_that_are_called() -> None:
    files = {Path(path).name for path in kernel._files(cast.cast_rays)}
    assert files == {"cast.py", "surface.py", "pyramid.py"}
    stamp = cast.cast_rays._cache._cache_file._source_stamp  # type: ignore[attr-defined]
    assert (surface.__file__, hashlib.sha256(Path(surface.__file__).read_bytes()).hexdigest()) in stamp
