"""List the topics, or describe one: its messages, rate, files, topic on the bus, fields with units.

  fti topics
  fti topics /nav/nav_solution
  fti topics /radalt/radio_height --json
  fti topics Reason

Names in angle brackets stand for names of the configuration. A topic can be given with or without them. Reason lists
the reasons of outputs that are not valid, with their texts. docs/topics.md and docs/reference/reasons.md have the same
as pages.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json, print_line, print_lines

if TYPE_CHECKING:
    from fti.messages.topics import Topic


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti topics``."""
    parser.add_argument(
        "name", nargs="?", metavar="TOPIC", help="the topic to describe; Reason: list the reasons of outputs"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print the list or the description."""
    from fti.errors import MissingError
    from fti.messages.topics import topics

    if args.name is not None and args.name.lower() == "reason":
        _print_reasons(as_json=args.json)
        return 0
    found = [topic for topic in topics() if args.name is None or args.name in (topic.name, topic.bus)]
    found = found or [topic for topic in topics() if topic.matches(args.name)]
    if not found:
        raise MissingError(f"no topic {args.name!r}; fti topics lists them")
    if args.json:
        print_json([describe(topic) for topic in found])
    elif args.name:
        print_lines(_description_lines(found[0]))
    else:
        width = max(len(topic.name) for topic in found)
        for topic in found:
            print_line(
                f"{topic.name:{width}}  {', '.join(topic.files) or 'bus only':22}  {topic.rate:35}  {topic.text}"
            )
    return 0


def _print_reasons(*, as_json: bool) -> None:
    """Print every reason with its text."""
    from fti.messages.reasons import Reason
    from fti.reason_texts import REASONS

    if as_json:
        print_json([{"reason": reason.value, "text": REASONS[reason]} for reason in Reason])
    else:
        width = max(map(len, Reason))
        print_lines(f"{reason:{width}}  {REASONS[reason]}" for reason in Reason)


def describe(topic: Topic) -> dict[str, Any]:
    """Description of a topic, in plain JSON types."""
    from fti.messages.topic_fields import fields

    return {
        "name": topic.name,
        "text": topic.text,
        "rate": topic.rate,
        "schema": topic.schema,
        "files": list(topic.files),
        "bus": topic.bus,
        "max_age_ms": topic.max_age_ms,
        "fields": [field._asdict() for field in fields(topic.content)] if topic.content else [],
    }


def _description_lines(topic: Topic) -> list[str]:
    import inspect

    from fti.messages.topic_fields import fields

    lines = [f"{topic.name}: {topic.text}", f"rate      {topic.rate}"]
    lines += [f"files     {', '.join(topic.files) or 'none'}", f"bus       {topic.bus or 'not published'}"]
    lines += [f"late      above {topic.max_age_ms:g} ms"] if topic.max_age_ms else []
    lines += [f"schema    {topic.schema or 'none'}"]
    if topic.content:
        lines += ["", *(inspect.getdoc(topic.content) or "").splitlines(), ""]
        lines += [f"  {field.name:24} {field.type:40} {field.unit}".rstrip() for field in fields(topic.content)]
    return lines
