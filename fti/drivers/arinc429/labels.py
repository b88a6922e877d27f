"""Label sets: the labels of an equipment and their meaning, as data.

A set is a table of TOML.  The sets of ``labels.toml`` are built in; a user file (option ``labels_file``) has the same
form, and its sets replace built-in ones of the same name:

    [my_altimeter]
    equipment = "007"        # hexadecimal identifier of ARINC 429 part 1, as in label 377; optional
    source = "maker's document, revision, table"
    labels = [
        { label = "164", quantity = "radio_height", unit = "ft", range = 8192.0, bits = 16 },
        { label = "165", quantity = "radio_height", unit = "ft", kind = "bcd", resolution = 0.1 },
        { label = "270", kind = "discrete", name = "discretes", flags = { self_test = 11, gear_down = 12 },
          not_ok = ["self_test"], fields = { mode = [13, 15] } },
    ]
"""

from __future__ import annotations

import importlib.resources
from functools import cache
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fti.config import StrictModel, bind, parse_toml
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers.arinc429.word import BNR_BITS_WITH_SDI, DISCRETE_HIGH, DISCRETE_LOW
from fti.errors import ConfigError
from fti.formats.quantities import QUANTITIES, to_si

Bit = Annotated[int, Field(ge=DISCRETE_LOW, le=DISCRETE_HIGH)]
Octal = Annotated[str, Field(pattern=r"^[0-3][0-7]{2}$")]
Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]

EQUIPMENT_LABEL = "377"


class Label(StrictModel):
    """One enabled label: a BNR or BCD word is a quantity or a reading, a discrete word a status and small numbers."""

    label: Annotated[Octal, key("octal digits of the label", NO_UNIT, "164")]
    kind: Annotated[Literal["bnr", "bcd", "discrete"], key("format of the word", NO_UNIT)] = "bnr"
    sdi: Annotated[
        Annotated[int, Field(ge=0, le=3)] | None,
        key("source identifier of the words that are used; none: any", NO_UNIT, 1),
    ] = None
    quantity: Annotated[str, key("quantity of the value; a number needs it or reading", NO_UNIT, "radio_height")] = ""
    reading: Annotated[Name | Literal[""], key("name of the reading, where the value is no quantity", NO_UNIT)] = ""
    unit: Annotated[str, key("unit of the value on the bus; empty: SI", NO_UNIT, "ft")] = ""
    range: Annotated[
        Positive | None, key("full scale of a BNR word, which needs it; none: another kind of word", "unit", 8192.0)
    ] = None
    bits: Annotated[
        Annotated[int, Field(ge=1, le=20)] | None,
        key("number of significant bits of a BNR word, which needs it; none: another kind of word", "bit", 16),
    ] = None
    resolution: Annotated[
        Positive | None,
        key("value of the last digit of a BCD word, which needs it; none: another kind of word", "unit", instead=0.1),
    ] = None
    sign: Annotated[Literal[1, -1], key("-1: this equipment uses the opposite sign", ONE)] = 1
    fine_label: Annotated[
        Octal | None, key("label with further bits below those of this label; none: there is none", NO_UNIT, "120")
    ] = None
    fine_bits: Annotated[int, Field(ge=1, le=18), key("number of the bits of fine_label", "bit")] = 11
    steps: Annotated[
        Literal["freeflight_ra4500"] | None,
        key("instrument whose step at the value gives the sigma; none: no sigma", NO_UNIT, "freeflight_ra4500"),
    ] = None
    name: Annotated[Name | Literal[""], key("name of a discrete word, which needs it", NO_UNIT)] = ""
    flags: Annotated[dict[Name, Bit], key("conditions of a discrete word, each with its bit", NO_UNIT)] = Field(
        default_factory=dict
    )
    not_ok: Annotated[tuple[str, ...], key("names of flags that make the equipment not ok", NO_UNIT)] = ()
    fields: Annotated[
        dict[Name, Annotated[tuple[Bit, ...], Field(min_length=2, max_length=3)]],
        key(
            "small numbers of a discrete word, each a reading with its lowest and highest bit, and a third bit where "
            "the "
            "most significant one is separate",
            NO_UNIT,
        ),
    ] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        wrong = self._wrong_discrete() if self.kind == "discrete" else self._wrong_name() or self._wrong_number()
        if wrong:
            raise ValueError(f"label {self.label}: {wrong}")
        return self

    def _wrong_discrete(self) -> str:
        if not self.name or not (self.flags or self.fields):
            return "a discrete word needs a name, and flags or fields"
        if unknown := set(self.not_ok) - set(self.flags):
            return f"not_ok names {', '.join(sorted(unknown))}; flags are {', '.join(self.flags) or 'none'}"
        if backward := [name for name, bits in self.fields.items() if bits[0] > bits[1]]:
            return f"field {backward[0]}: the lowest bit must be first"
        return ""

    def _wrong_name(self) -> str:
        if bool(self.quantity) == bool(self.reading):
            return "needs exactly one of quantity and reading"
        if self.quantity and self.quantity not in QUANTITIES:
            return f"no quantity {self.quantity!r}; there are {', '.join(QUANTITIES)}; or give a reading"
        if self.quantity:
            to_si(self.quantity, self.unit)
        if self.steps and self.quantity != "radio_height":
            return "steps needs the quantity radio_height"
        return ""

    def _wrong_number(self) -> str:
        if self.kind == "bcd" and self.fine_label:
            return "a BCD word has no fine_label"
        if self.kind == "bcd":
            return "" if self.resolution is not None else "a BCD word needs resolution"
        if self.range is None or self.bits is None:
            return "a BNR word needs range and bits"
        if self.sdi is not None and self.bits > BNR_BITS_WITH_SDI:
            return f"a word of {self.bits} bits has no sdi"
        return ""


class LabelSet(StrictModel):
    """``[NAME]``: the labels of one equipment; ``set = "NAME"`` selects them."""

    equipment: Annotated[
        Annotated[str, Field(pattern=r"^[0-9A-F]{3}$")] | None,
        key(
            "identifier of the equipment in label 377; another one gives a status that is not ok; none: any",
            NO_UNIT,
            "007",
        ),
    ] = None
    source: Annotated[str, key("document from which the labels are", NO_UNIT)] = ""
    labels: Annotated[
        tuple[Label, ...],
        key(
            "[[NAME.labels]]: the labels",
            NO_UNIT,
            [{"label": "164", "quantity": "radio_height", "unit": "ft", "range": 8192.0, "bits": 16}],
        ),
    ]


def read_sets(text: str, file: str) -> dict[str, LabelSet]:
    """The sets of a TOML text by name.  Raises ValueError or ConfigError with file, key and allowed values."""
    try:
        tables = parse_toml(text, file)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise ValueError(f"{file}: {name}: must be a table with labels, [{name}]")
    return {name: bind(LabelSet, table, file, name) for name, table in tables.items()}


@cache
def built_in_sets() -> dict[str, LabelSet]:
    """The built-in sets by name."""
    text = importlib.resources.files(__package__).joinpath("labels.toml").read_text(encoding="utf-8")
    return read_sets(text, "arinc429/labels.toml")


def choose(name: str, own_text: str) -> LabelSet:
    """A set by name, from the user's text or built in; "none" is empty.  Raises ValueError with the existing names."""
    if name == "none":
        return LabelSet(labels=())
    own = read_sets(own_text, "labels_file") if own_text else {}
    if label_set := own.get(name) or built_in_sets().get(name):
        return label_set
    available = f"; in labels_file: {', '.join(own)}" if own else ""
    raise ValueError(f"set {name!r}: unknown set; built in: {', '.join(built_in_sets())}, none{available}")
