#!/usr/bin/env python3
"""Makes python/motor_gateway/configuration.py of what `mgw config schema` prints.

    mgw config schema | configuration_classes.py --write    writes it
    mgw config schema | configuration_classes.py --check    says whether it is as committed
"""

import json
import sys
import textwrap
from pathlib import Path
from typing import Any, Dict, List

HOME = Path(__file__).parent
PLACE = HOME / "python" / "motor_gateway" / "configuration.py"
EXAMPLE = HOME.parent / "cli" / "examples" / "four-motors.toml"
TYPES = {"integer": "int", "number": "float", "boolean": "bool", "string": "str"}
WIDTH = 100
HEAD = '''"""The configuration of a gateway as dataclasses: the keys of a configuration file.

Made by configuration_classes.py from the tables of the gateway's parameters; do not edit.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Dict, List, Literal, Optional, Sequence, Union
'''
TAIL = '''

@dataclass
class Configuration:
    """Everything that is configured; what is not in it has its default."""

    buses: Sequence[Bus] = ()
    axes: Sequence[Axis] = ()
    gateway: GatewaySettings = field(default_factory=GatewaySettings)

    def to_dict(self) -> Dict[str, Any]:
        """As a dictionary with the keys of a file."""
        return {
            "gateway": _given(self.gateway),
            "bus": [_given(bus) for bus in self.buses],
            "axis": [_given(axis) for axis in self.axes],
        }


def _given(row: Any) -> Dict[str, Any]:
    return {name: value for name, value in asdict(row).items() if value is not None}


'''


def type_of(key: Dict[str, Any]) -> str:
    if "enum" in key:
        return f"Literal[{', '.join(quoted(value) for value in key['enum'])}]"
    if key["type"] == "array":
        return f"List[{type_of(key['items'])}]"
    if isinstance(key["type"], list):
        return f"Union[{', '.join(TYPES[name] for name in key['type'])}]"
    return TYPES[key["type"]]


def quoted(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def comment(key: Dict[str, Any]) -> List[str]:
    text = key["description"]
    if "minimum" in key and "maximum" in key:
        text += f" {key['minimum']} to {key['maximum']}."
    if "default" in key:
        text += f" Default {key['default']}."
    return textwrap.wrap(text, WIDTH - 8)


def dataclass(name: str, doc: str, section: Dict[str, Any]) -> str:
    lines = ["", "", "", "@dataclass", f"class {name}:", f'    """{doc}"""', ""]
    # What a file needs of a row: that it may say that it is incomplete is for dumps.
    whole = section.get("anyOf", [{}])[0].get("required", [])
    keys, required = section["properties"], [*section["required"], *whole]
    optional = [key for key in keys if key not in required]
    for key in [*required, *optional]:
        lines += [f"    #: {line}" for line in comment(keys[key])]
        kind = type_of(keys[key])
        lines.append(f"    {key}: {kind}" if key in required else
                     f"    {key}: Optional[{kind}] = None")
    return "\n".join(lines)


def example() -> str:
    import tomllib

    rows = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))

    def row(name: str, values: Dict[str, Any]) -> str:
        given = ", ".join(
            f"{key}=[{', '.join(map(quoted, value))}]" if isinstance(value, list) else
            f"{key}={quoted(value)}"
            for key, value in values.items()
        )
        return textwrap.fill(f"{name}({given}),", WIDTH, initial_indent=" " * 8,
                             subsequent_indent=" " * 12, break_long_words=False)

    return "\n".join(
        ["", "#: The configuration of the four motors of a simulator: four-motors.toml.",
         "FOUR_MOTORS = Configuration(",
         f"    gateway={row('GatewaySettings', rows['gateway']).strip()}", "    buses=[",
         *(row("Bus", bus) for bus in rows["bus"]), "    ],", "    axes=[",
         *(row("Axis", axis) for axis in rows["axis"]), "    ],", ")", ""]
    )


def text(sections: Dict[str, Any]) -> str:
    return "".join([
        HEAD,
        dataclass("GatewaySettings", "What holds for the gateway as a whole.", sections["gateway"]),
        dataclass("Bus", "A bus.", sections["bus"]["items"]),
        dataclass("Axis", "An axis: a motor on a bus, and what it may do.",
                  sections["axis"]["items"]),
        "\n", TAIL, example().lstrip("\n"),
    ])


if __name__ == "__main__":
    made = text(json.load(sys.stdin)["properties"])
    if sys.argv[1:] == ["--write"]:
        PLACE.write_text(made, encoding="utf-8")
    elif sys.argv[1:] == ["--check"]:
        if made != PLACE.read_text(encoding="utf-8"):
            sys.exit(f"{PLACE} is not what the parameters make: run `.ci/python classes`")
    else:
        sys.exit(__doc__)
