"""The verdict of a lap that is not over: the same checks as of a run, in words for the page."""

from typing import NamedTuple

from pivoting.sim.judging.verdict import Check
from pivoting.sim.run import Run

AT_THE_END = "contacts_missing"  # that there have to be only then
WORDS = {  # check -> what it is of, factor, unit
    "slip_max_m": ("slip of the contact", 1e3, "mm"),
    "angle_error_rms_deg": ("angle error, RMS", 1.0, "deg"),
    "angle_error_max_deg": ("angle error, greatest", 1.0, "deg"),
    "contact_lost_s": ("contact lost", 1.0, "s"),
    "undeclared_contact_s": ("touching elsewhere", 1.0, "s"),
    "penetration_rel": ("sinking in, in levers", 1.0, ""),
    "friction_use_max": ("friction used, of 1", 1.0, ""),
    "force_mismatch_rel": ("contact force not as predicted", 100.0, "%"),
    "unsolved_steps": ("steps without an answer", 1.0, ""),
    "contacts_missing": ("contacts missing at the end", 1.0, ""),
    "bounce_m": ("bounce after landing", 1e3, "mm"),
}
HEAD = "<tr style='text-align:right'><th style='text-align:left'>check</th><th>measured</th><th>limit</th></tr>"
RED, GREEN, GREY = "#d62728", "#2ca02c", "#888888"


class SoFar(NamedTuple):
    """verdict: "settling", "pass" or "fail".  checks: of the lap so far; none while it settles."""

    verdict: str
    checks: tuple[Check, ...]


def verdict_so_far(run: Run) -> SoFar:
    """Of a lap that may not be over: what counts at its end is shown, but fails nothing yet."""
    if run.time[-2] < run.scenario.limits.settle_s + 2.0 * run.dt:
        return SoFar("settling", ())
    failed = any(not check.passed for check in run.checks if check.name != AT_THE_END)
    return SoFar("fail" if failed else "pass", run.checks)


def in_words(found: SoFar, run: Run) -> str:
    """What a newcomer should know of it first, in one sentence."""
    if found.verdict == "settling":
        return f"The start may take {run.scenario.limits.settle_s:g} s to settle."
    over = {check.name: check for check in found.checks if not check.passed and check.name != AT_THE_END}
    slip = next(check for check in found.checks if check.name == "slip_max_m")
    if "slip_max_m" in over:
        return f"The contact has slipped by {1e3 * slip.value:.3g} mm, and {1e3 * slip.limit:.3g} mm are allowed."
    if over:
        what, factor, unit = WORDS[next(iter(over))]
        check = next(iter(over.values()))
        return f"The contact sticks, but: {what} {factor * check.value:.3g} {unit}, allowed {factor * check.limit:.3g}."
    return f"The contact sticks: {1e3 * slip.value:.3g} mm of slip, of {1e3 * slip.limit:.3g} mm allowed."


def as_html(found: SoFar, run: Run) -> str:
    """The verdict, the sentence and the table of the checks."""
    colour = {"pass": GREEN, "fail": RED}.get(found.verdict, GREY)
    rows = "".join(_row(check) for check in found.checks)
    table = f"<table style='width:100%;font-size:0.8em;border-collapse:collapse'>{HEAD}{rows}</table>" if rows else ""
    return (
        "<div style='padding:0 1.4em 0 0.6em;line-height:1.3;min-height:215px'>"
        f"<div id='verdict' style='font-size:1.25em;font-weight:700;color:{colour}'>{found.verdict.upper()}"
        "<span style='font-weight:400;font-size:0.65em;opacity:0.8'> so far, in this lap</span></div>"
        f"<div style='font-size:0.85em;margin-bottom:0.4em'>{in_words(found, run)}</div>{table}</div>"
    )


def _row(check: Check) -> str:
    what, factor, unit = WORDS[check.name]
    late = check.name == AT_THE_END
    colour = GREY if late else (GREEN if check.passed else RED)
    mark = "&middot;" if late else ("&#10003;" if check.passed else "&#10007;")
    return (
        f"<tr style='text-align:right'><td style='text-align:left'>"
        f"<span style='color:{colour};font-weight:700'>{mark}</span> {what}</td>"
        f"<td style='color:{colour}'>{factor * check.value:.3g} {unit}</td>"
        f"<td style='opacity:0.7'>{factor * check.limit:.3g}</td></tr>"
    )
