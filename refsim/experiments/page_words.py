"""Words and numbers of the page: what a verdict is called and looks like, and numbers as people write them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup, escape

from refsim.experiments.ledger_rules import (
    CONTRADICTED,
    CORRECTED,
    HARDWARE,
    MISSING_MESH,
    NOT_MEASURED,
    REPRODUCED,
    TREND,
    UNSAID,
)
from refsim.experiments.registry import Rows

MINUS = "−"
RATIO = "ratio"  # a unit that is none
FEW_PAIRS = 4  # that are shown rather than summed up
SUFFIXES = ((1e9, "G"), (1e6, "M"))
SCIENTIFIC = re.compile(r"(?<![\w.])[-−]?\d(?:\.\d+)?e[+-]\d+")
VERBS = {"holds": "hold", "depends": "depend", "fails": "fail"}
SAME = re.compile(r"(\S+) to \1(?= |$)")  # 12.5 to 12.5, when rounded
COUNTED = re.compile(r" \(\d+ values\)$")
TIMES = re.compile(r"(?<![\w])x(?= \d)|(?<= )\*(?= )")
APOSTROPHE = re.compile(r"(?<=\w)'(?=\w|\s)")
LONG = re.compile(r"(?<![\w.,])\d{5,}(?![\w.])")


@dataclass(frozen=True)
class Mark:
    """How a verdict is shown: `slug` names colour and icon, `word` is read, `means` explains."""

    slug: str
    word: str
    means: str


MARKS = {
    REPRODUCED: Mark("reproduced", "reproduced", "What is said holds at the paper's setting, within the tolerance."),
    TREND: Mark("trend", "trend reproduced", "Not the number, or not everywhere, but its direction."),
    CORRECTED: Mark("corrected", "corrected", "Not as printed; with the slip put right it holds. Both were run."),
    CONTRADICTED: Mark("contradicted", "contradicted", "What was measured says otherwise."),
    HARDWARE: Mark("hardware", "cannot be reproduced: hardware", "Only the paper's own machine could show it."),
    MISSING_MESH: Mark("mesh", "cannot be reproduced: mesh missing", "The body that it is about is not at hand."),
    UNSAID: Mark("unsaid", "cannot be reproduced: not enough said", "The paper leaves open what decides it."),
    NOT_MEASURED: Mark("unmeasured", "not measured", "No row of a run of this size shows it."),
}  # fmt: skip


def number(value: Any) -> str:
    """12345 -> 12,345; 150000000.0 -> 150 M, if four digits say it all; other values as text."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return sentence(str(value))
    for size, suffix in SUFFIXES:
        if abs(value) >= size and float(f"{value:.4g}") == value:
            return f"{value / size:.4g} {suffix}".replace("-", MINUS)
    if abs(value) >= 1e15 or 0 < abs(value) < 1e-4:
        return f"{value:.3g}".replace("-", MINUS)
    text = f"{value:,}" if isinstance(value, int) else f"{value:,.10g}"
    return text.replace("-", MINUS)


def short(value: Any) -> str:
    """A number to four digits."""
    return number(float(f"{value:.4g}")) if isinstance(value, float) else number(value)


def sentence(text: str) -> str:
    """A line of the ledger with its numbers as people write them: 1.507e+08 -> 150.7 M, 4725909 -> 4,725,909."""

    def written(found: re.Match[str]) -> str:
        value = float(found[0].replace(MINUS, "-"))
        large = [(size, suffix) for size, suffix in SUFFIXES if abs(value) >= size]
        if large:
            return f"{value / large[0][0]:.4g} {large[0][1]}".replace("-", MINUS)
        return number(value if abs(value) < 1 else int(value))

    text = LONG.sub(lambda found: f"{int(found[0]):,}", SCIENTIFIC.sub(written, text))
    return APOSTROPHE.sub("’", TIMES.sub("×", text))


def printed(entry: dict[str, Any]) -> str:
    """What the paper prints, with its unit; '' where it is words alone."""
    value, unit = entry["printed"], entry["unit"]
    if value is None or (isinstance(value, str) and not value.startswith("@")):
        return ""
    if isinstance(value, str):
        pairs = _pairs(entry)
        numbers = list(dict.fromkeys(number(theirs) for _, theirs in pairs))
        text = " · ".join(numbers) if 0 < len(numbers) <= FEW_PAIRS else ""
    elif isinstance(value, list):
        text = " to ".join(number(part) for part in value)
    else:
        text = number(value)
    if text and unit.startswith(RATIO):
        return f"{text} ({unit})"
    return f"{text} {unit}".strip() if text else ""


def measured(entry: dict[str, Any], lines: Rows) -> str:
    """What was measured: our numbers beside printed ones, the rule's own line, or how many `lines` hold."""
    if lines:
        return _held([str(row["verdict"]) for row in lines])
    line = SAME.sub(r"\1", sentence(entry["measured"]))
    counted = COUNTED.search(line)
    bare = COUNTED.sub("", line)
    pairs = _pairs(entry)
    if 0 < len(pairs) <= FEW_PAIRS:
        numbers = " · ".join(number(ours) for ours, _ in pairs)
        return f"{numbers} ({bare} of what is printed)" if line.startswith("×") else numbers
    if isinstance(entry["printed"], int | float | list) and line[:1].isdigit() and not entry["unit"].startswith(RATIO):
        return f"{bare} {entry['unit']}".strip() + (counted[0] if counted else "")
    return line


def _pairs(entry: dict[str, Any]) -> list[list[Any]]:
    """Evidence as (ours, printed), where the printed numbers stand in a column beside ours."""
    beside = isinstance(entry["printed"], str) and entry["printed"].startswith("@")
    return [part for part in entry["evidence"] if isinstance(part, list) and len(part) == 2] if beside else []


def _held(verdicts: list[str]) -> str:
    counts = {word: verdicts.count(word) for word in VERBS if word in verdicts}
    if len(counts) == 1 and len(verdicts) > 1:
        return f"{'Both' if len(verdicts) == 2 else f'All {len(verdicts)}'} lines {VERBS[verdicts[0]]}"
    each = [f"{n} {word if n == 1 else VERBS[word]}" for word, n in counts.items()]
    return f"Of {len(verdicts)} lines, {', '.join(each)}" if len(verdicts) > 1 else "".join(each)


def rule_text(entry: dict[str, Any], lines: Rows) -> str:
    """The rule, with its tolerance and the reason for it; that of the `lines` of a table, if they have one."""
    rules = {str(row["rule"]) for row in lines}
    because = f" ({entry['reason']})" if entry["reason"] else ""
    if len(rules) == 1:
        return sentence(rules.pop()) + because
    if not entry["tolerance"]:
        return f"{entry['rule']}{because}"
    # A share of what is printed; errors of a model are percentages already
    tolerance = entry["tolerance"] if entry["tolerance"] > 1 else 100 * entry["tolerance"]
    return f"{entry['rule']}: {tolerance:g} percent, for {entry['reason']}"


def code(text: str) -> Markup:
    """Text whose `backticks` mark code."""
    parts = [
        f"<code>{escape(part)}</code>" if k % 2 else str(escape(APOSTROPHE.sub("’", part)))
        for k, part in enumerate(text.split("`"))
    ]
    return Markup("".join(parts)) if len(parts) % 2 else escape(text)


def column(name: str) -> str:
    """`eye_rays_that_hit_percent` -> `eye rays that hit percent`."""
    return name.replace("_", " ")
