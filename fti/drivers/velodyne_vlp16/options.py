"""Options of the driver."""

from __future__ import annotations

from typing import Annotated, Literal

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key


class Options(StrictModel):
    """The decoder needs none."""

    return_mode: Annotated[
        Literal["strongest", "last", "dual"],
        key("returns that the emulated scanner states; the decoder accepts every mode", NO_UNIT),
    ] = "strongest"
