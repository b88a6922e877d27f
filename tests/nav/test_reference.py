"""The reference file: there and back, hash, mistakes named by file, line and key."""

import dataclasses

import numpy as np
import pytest

from fti.errors import ConfigError
from fti.nav.integrity.reference import ApproachReference


def test_text_and_back(reference: ApproachReference) -> None:
    again = ApproachReference.parse(reference.to_text(), "r.csv")
    assert again.header == reference.header
    assert again.hash == reference.hash
    np.testing.assert_allclose(again.z_ref, reference.z_ref, atol=5e-4)
    assert again.to_text() == reference.to_text()


def test_hash_is_of_the_content(reference: ApproachReference) -> None:
    lines = reference.to_text().splitlines()
    lines[-1] = lines[-1].replace(",1.000,", ",1.001,")
    with pytest.raises(ConfigError, match=r"r\.csv:\d+: hash = "):
        ApproachReference.parse("\n".join(lines), "r.csv")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("# fti reference", "# reference", r"r\.csv:1: "),
        ("# limits.t2 = 9.0", "# limits.t2 = -9.0", r"r\.csv:\d+: limits\.t2 = -9\.0"),
        ("# limits.t2 = 9.0\n", "", r"r\.csv: limits\.t2: missing"),
        ("# limits.t2 = 9.0", "# limits.t2 = nine", r"r\.csv:\d+: limits\.t2 = nine: is not a value"),
        ("# limits.t2 = 9.0", "limits.t2 = 9.0", r"r\.csv:\d+: 'limits\.t2 = 9\.0': must be"),
        ("# limits.t2 = 9.0", "# limits.t1 = 9.0", r"r\.csv:\d+: limits\.t1: defined twice"),
        ('"radar"', '"sonar"', r"r\.csv:\d+: sensor\.kind = 'sonar'"),
        ("s_m,z_ref_m", "s,z", r"is missing"),
        ("\n-195.000,", "\n-194.000,", r"r\.csv:\d+: s_m = -194\.0: must be -195\.0"),
        ("\n-195.000,", "\n-195.000;", r"r\.csv:\d+: '-195\.000;.*must be 4 numbers"),
        ("\n-195.000,", "\nnan,", r"must be 4 numbers"),
    ],
)
def test_mistakes_name_file_line_and_key(reference: ApproachReference, old: str, new: str, message: str) -> None:
    text = reference.to_text()
    assert old in text
    with pytest.raises(ConfigError, match=message):
        ApproachReference.parse(text.replace(old, new), "r.csv")


def test_line_in_the_message_is_the_line_of_the_key(reference: ApproachReference) -> None:
    text = reference.to_text().replace("# limits.t2 = 9.0", "# limits.t2 = -9.0")
    line = text.splitlines().index("# limits.t2 = -9.0") + 1
    with pytest.raises(ConfigError, match=rf"r\.csv:{line}: limits\.t2"):
        ApproachReference.parse(text, "r.csv")


@pytest.mark.parametrize("column", ["s_ref", "s_alt"])
def test_a_sigma_of_zero_is_no_sigma(reference: ApproachReference, column: str) -> None:
    """Its weight would be infinite, every statistic no number, and no test would ever be over its limit."""
    zero = np.zeros_like(reference.s)
    broken = {"s_ref": dataclasses.replace(reference, s_ref=zero), "s_alt": dataclasses.replace(reference, s_alt=zero)}
    with pytest.raises(ConfigError, match=rf"r\.csv:\d+: {column}_m = 0\.0: must be > 0"):
        ApproachReference.parse(broken[column].to_text(), "r.csv")


def test_the_window_holds_8_correlation_lengths(reference: ApproachReference) -> None:
    profile = reference.header.profile.model_copy(update={"correlation_m": 50.1})
    long = dataclasses.replace(reference, header=reference.header.model_copy(update={"profile": profile}))
    with pytest.raises(ConfigError, match=r"r\.csv: profile\.correlation_m = 50\.1: must be at most window_m / 8"):
        ApproachReference.parse(long.to_text(), "r.csv")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"window_m": 3005.0}, r"r\.csv: profile\.window_m = 3005\.0: must be at most s_max_m = 3000\.0"),
        ({"ds_m": 7.0}, r"r\.csv: profile\.ds_m = 7\.0: must divide the margin, 200\.0"),
        ({"window_m": 402.0}, r"r\.csv: profile\.ds_m = 5\.0: must divide window_m, 402\.0"),
        ({"ds_m": 1e-9}, r"r\.csv:\d+: profile\.ds_m = 1e-09"),
        ({"s_max_m": 1e12}, r"r\.csv:\d+: profile\.s_max_m = "),
    ],
)
def test_a_window_lies_on_the_grid_with_all_its_shifts(
    reference: ApproachReference, changed: dict[str, float], message: str
) -> None:
    """What lies beyond is read by compiled code, from whatever memory is there."""
    profile = reference.header.profile.model_copy(update=changed)
    broken = dataclasses.replace(reference, header=reference.header.model_copy(update={"profile": profile}))
    with pytest.raises(ConfigError, match=message):
        ApproachReference.parse(broken.to_text(), "r.csv")


def test_missing_rows_are_counted(reference: ApproachReference) -> None:
    with pytest.raises(ConfigError, match="680 rows"):
        ApproachReference.parse("\n".join(reference.to_text().splitlines()[:-1]), "r.csv")
