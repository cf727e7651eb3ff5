"""Hold a pytest run against what it must reach: ``python .ci/guard.py junit.xml fast|slow [--data]``.

A run cannot be green by skipping: fewer tests passed than ``floor`` says fail it, and so does a skip whose reason is
not among the allowed ones. With ``--data`` (reference data and every extra are there) only those of the machine count.
"""

from __future__ import annotations

import re
import sys
import tomllib
import xml.etree.ElementTree as tree
from collections import Counter
from pathlib import Path

RULES = Path(__file__).with_name("guard.toml")


def faults(junit: Path, run: str, data: bool) -> list[str]:
    """What a run lacks."""
    rules = tomllib.loads(RULES.read_text(encoding="utf-8"))
    cases = list(tree.parse(junit).iter("testcase"))
    skips = Counter(
        f"{s.get('message')} {s.text or ''}".strip()
        for case in cases
        for s in case.findall("skipped")
        if s.get("type") != "pytest.xfail"
    )
    failed = sum(bool(case.findall("failure") or case.findall("error")) for case in cases)
    passed = len(cases) - failed - sum(bool(case.findall("skipped")) for case in cases)
    allowed = [*rules["machine"], *([] if data else rules["data"] + rules["extras"])]
    floor = rules["floor"][f"{run}_with_data" if data else run]
    out = [f"{failed} tests failed"] if failed else []
    out += [f"{passed} tests passed; {floor} or more must"] if passed < floor else []
    return out + [f"skipped {n} times without leave: {why}" for why, n in sorted(skips.items())
                  if not any(re.search(pattern, why) for pattern in allowed)]  # fmt: skip


if __name__ == "__main__":
    wrong = faults(Path(sys.argv[1]), sys.argv[2], "--data" in sys.argv)
    print("\n".join(wrong) or "as many tests passed as must, and none was skipped without leave")
    sys.exit(bool(wrong))
